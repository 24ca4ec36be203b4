// The page: the scene with its words and buttons, played back or driven.

import {
  BeamsMesh, Estimate, Inset, MapBands, Obstacles, Replay, Rig, Stage, Trail, VIEWS, css, keyList, savePicture,
  toggleFullScreen,
} from "lrf3d-view";

const SPEEDS = [0.5, 1, 2, 4, 8, 16];
const STEP = 2; // Seconds that an arrow key skips.
const LONGEST = 0.5; // Seconds that a frame stands for at most: a hidden page draws none.
const BLEND = 0.04; // Seconds in which a driven robot comes nearer to its newest known pose.
const ICONS = { follow: "videocam", orbit: "3d_rotation", top: "map", first: "visibility" };
const NAMES = { follow: "Follow", orbit: "Orbit", top: "From above", first: "Robot's eyes" };

const TOOLS = [
  { name: "picture", icon: "photo_camera", label: "save a picture", key: "P" },
  { name: "full", icon: "fullscreen", label: "full screen", key: "F" },
  { name: "list", icon: "keyboard", label: "keys", key: "H" },
];

const KEYS = {
  ArrowUp: "ahead",
  KeyW: "ahead",
  ArrowDown: "back",
  KeyS: "back",
  ArrowLeft: "left",
  KeyA: "left",
  ArrowRight: "right",
  KeyD: "right",
};

// A number in so many decimals, and never −0.
function rounded(value, decimals) {
  const text = value.toFixed(decimals);
  return Number(text) === 0 ? (0).toFixed(decimals) : text;
}

export default {
  props: { setup: Object },
  emits: ["drive", "again"],

  template: `
    <div class="lrf3d">
      <div ref="place" class="lrf3d-scene"></div>
      <div class="lrf3d-panel lrf3d-hud">
        <div class="lrf3d-title">lrf3d <span>{{ setup.title }}</span></div>
        <div><span>t <b class="lrf3d-t">{{ words.t }}</b> s</span> &ensp;
          <span>v <b class="lrf3d-v">{{ words.v }}</b> m/s</span> &ensp; <span>ω <b>{{ words.w }}</b> °/s</span></div>
        <div><span>x <b class="lrf3d-x">{{ words.x }}</b></span> &ensp;
          <span>y <b class="lrf3d-y">{{ words.y }}</b></span> &ensp; <span>θ <b class="lrf3d-theta">{{ words.theta }}</b>°</span></div>
        <div class="lrf3d-warm">{{ words.beams }}</div>
        <div class="lrf3d-map">{{ words.map }}</div>
        <div v-if="legend.truth" class="lrf3d-truth" :style="{ color: legend.truthColour }">━ {{ legend.truth }}</div>
        <div v-if="legend.believed" class="lrf3d-believed" :style="{ color: legend.believedColour }">━ {{ legend.believed }}
          &ensp; {{ words.apart }}</div>
        <div v-if="bumped" class="lrf3d-stop">a wall is in the way</div>
      </div>
      <canvas ref="inset" v-show="view !== 'top'" class="lrf3d-inset"></canvas>
      <div v-if="failure" class="lrf3d-panel lrf3d-failure">{{ failure }}</div>
      <div v-if="loading && !failure" class="lrf3d-panel lrf3d-failure">getting ready …</div>

      <dl v-if="listed" class="lrf3d-panel lrf3d-keys">
        <template v-for="[name, what] in keys" :key="name"><dt>{{ name }}</dt><dd>{{ what }}</dd></template>
      </dl>

      <div v-if="!setup.replay" class="lrf3d-pads">
        <button v-for="pad in ['left', 'ahead', 'back', 'right']" :key="pad"
          :class="['lrf3d-pad', 'lrf3d-pad-' + pad, { 'lrf3d-held': held[pad] }]" :aria-label="pad"
          @pointerdown.prevent="hold(pad, true, $event)" @pointerup="hold(pad, false)"
          @pointercancel="hold(pad, false)" @lostpointercapture="hold(pad, false)"
          @contextmenu.prevent>
          <q-icon :name="'keyboard_arrow_' + { left: 'left', ahead: 'up', back: 'down', right: 'right' }[pad]" />
        </button>
      </div>

      <div class="lrf3d-panel lrf3d-bar">
        <template v-if="setup.replay">
          <q-btn round flat dense class="lrf3d-play" :icon="playing ? 'pause' : time >= end ? 'replay' : 'play_arrow'"
            :aria-label="playing ? 'pause' : 'play'" @click="toggle" />
          <q-slider class="lrf3d-slider" v-model="time" :min="0" :max="end" :step="0" color="orange"
            aria-label="time" @pan="(phase) => (scrubbing = phase === 'start')" />
          <span class="lrf3d-clock">{{ clock(time) }} / {{ clock(end) }}</span>
          <q-btn flat dense no-caps class="lrf3d-speed" :label="speed + '×'" aria-label="speed">
            <q-menu auto-close dark><q-list dense>
              <q-item v-for="value in speeds" :key="value" clickable @click="speed = value">
                <q-item-section>{{ value }}×</q-item-section></q-item>
            </q-list></q-menu>
          </q-btn>
        </template>
        <template v-else>
          <span class="lrf3d-hint">Drive with WASD, the arrow keys or the pads</span>
          <q-btn flat dense no-caps icon="restart_alt" label="Start again" class="lrf3d-again" @click="again" />
        </template>
        <span class="lrf3d-gap"></span>
        <q-btn v-for="name in views" :key="name" round flat dense :icon="icons[name]"
          :class="'lrf3d-view-' + name" :color="view === name ? 'orange' : 'grey-4'"
          :aria-label="names[name]" @click="choose(name)">
          <q-tooltip>{{ names[name] }} (V)</q-tooltip>
        </q-btn>
        <span class="lrf3d-gap"></span>
        <q-btn v-for="tool in tools" :key="tool.name" round flat dense :icon="tool.icon"
          :class="'lrf3d-' + tool.name" color="grey-4" :aria-label="tool.label" @click="use(tool.name)">
          <q-tooltip>{{ tool.label }} ({{ tool.key }})</q-tooltip>
        </q-btn>
      </div>
    </div>`,

  data() {
    return {
      views: VIEWS,
      speeds: SPEEDS,
      icons: ICONS,
      names: NAMES,
      tools: TOOLS,
      keys: keyList(Boolean(this.setup.replay)),
      listed: false,
      view: "follow",
      time: 0,
      end: 0,
      speed: this.setup.speed,
      playing: false,
      scrubbing: false,
      loading: true,
      bumped: false,
      failure: "",
      held: { ahead: false, back: false, left: false, right: false },
      words: { t: "0.0", v: "0.00", w: "0", x: "", y: "", theta: "", beams: "", map: "", apart: "" },
      legend: {},
    };
  },

  async mounted() {
    try {
      await this.build();
    } catch (error) {
      this.failure = `This browser cannot show the scene: ${error.message}`;
      throw error;
    }
    this.onKey = (event) => this.key(event);
    this.onBlur = () => Object.keys(this.held).forEach((way) => this.hold(way, false));
    document.addEventListener("keydown", this.onKey);
    document.addEventListener("keyup", this.onKey);
    window.addEventListener("blur", this.onBlur);
    this.loading = false;
    if (this.early) this.state(this.early);
    this.playing = Boolean(this.setup.replay);
    this.last = performance.now();
    this.frame(this.last);
  },

  unmounted() {
    cancelAnimationFrame(this.waiting);
    document.removeEventListener("keydown", this.onKey);
    document.removeEventListener("keyup", this.onKey);
    window.removeEventListener("blur", this.onBlur);
  },

  methods: {
    async build() {
      // Nothing of this is for Vue to watch: it would wrap every array of every buffer.
      const { setup } = this;
      this.stage = new Stage(this.$refs.place, setup);
      await this.stage.load(setup.glb);
      const { scene } = this.stage;
      this.beams = new BeamsMesh(scene, setup.laser, setup.look, setup.mirrors);
      this.trail = new Trail(scene, setup.look.trail);
      this.bands = new MapBands(scene, setup.look.map);
      this.obstacles = new Obstacles(scene, this.stage.root, setup.obstacles);
      this.inset = new Inset(this.$refs.inset, setup);
      this.rig = new Rig(this.stage, { ...setup, height: setup.laser.height });
      if (setup.replay) {
        this.run = await Replay.load(setup.replay.file, setup.replay.layout, setup.laser.angles.length);
        this.end = this.run.end;
        this.trail.set(this.run.places(), new Set(setup.replay.jumps));
        this.pose = this.run.pose(0);
        if (setup.replay.legend.length) this.showEstimate(scene);
      } else {
        this.pose = { ...setup.start, speed: 0, turning: 0 };
        this.trail.set([this.pose.x, this.pose.y]);
        this.news = null;
      }
      this.shownStage = null;
      this.choose(this.view);
    },

    // Beside the truth, where that is known: a recorded drive has only the estimate.
    showEstimate(scene) {
      const { look, replay } = this.setup;
      const [truth, believed] = replay.legend;
      this.estimate = new Estimate(scene, this.run, look.estimate);
      this.trail.mesh.visible = replay.knowsTruth;
      const pale = (colour) => css(colour.map((part) => 0.65 * part + 0.35));
      this.legend = {
        truth: replay.knowsTruth ? truth : "",
        believed,
        truthColour: pale(look.trail.colour),
        believedColour: pale(look.estimate.colour),
      };
    },

    frame(now) {
      const seconds = Math.min(LONGEST, (now - this.last) / 1000);
      this.last = now;
      if (this.inset.fit()) this.shownTime = null;
      if (this.run) this.play(seconds);
      else this.follow(seconds);
      this.stage.place(this.pose);
      this.beams.dotPaint.uniforms.focus.value =
        this.stage.canvas.height / (2 * Math.tan((this.stage.camera.fov * Math.PI) / 360));
      const turned = this.rig.update(this.pose, seconds);
      if (this.changed || turned) this.stage.render(this.view);
      this.changed = false;
      this.waiting = requestAnimationFrame((next) => this.frame(next));
    },

    play(seconds) {
      if (this.playing && !this.scrubbing) {
        this.time = Math.min(this.end, this.time + seconds * this.speed);
        if (this.time >= this.end) this.playing = false;
      }
      const { run, time } = this;
      if (time === this.shownTime) return;
      this.shownTime = time;
      this.changed = true;
      this.pose = run.pose(time);
      const scan = run.scan(time);
      this.showScan(scan.pose, scan.ranges, scan.joined, scan.on, scan.darkness);
      const stage = run.stage(time);
      if (stage !== this.shownStage) {
        this.shownStage = stage;
        this.showMap(run.map(stage));
      }
      this.obstacles.show(run.obstacles(time));
      const legs = run.legs(time);
      this.trail.show(legs, this.pose);
      if (this.estimate) this.sayApart(this.estimate.show(time));
      this.inset.show(this.pose, this.trail, legs, this.beamsSeen(), scan.on, this.obstacles, this.estimate);
      this.say(this.setup.replay.start + time);
    },

    // Go on from one known pose of the driven robot to the next.
    follow(seconds) {
      if (!this.news) return;
      this.changed = true;
      const share = 1 - Math.exp(-seconds / BLEND);
      const { pose: from, news } = this;
      this.pose = {
        ...news.pose,
        x: from.x + share * (news.pose.x - from.x),
        y: from.y + share * (news.pose.y - from.y),
        theta: from.theta + share * (news.pose.theta - from.theta),
      };
      const [x, y] = this.trail.places.slice(-2);
      if (Math.hypot(this.pose.x - x, this.pose.y - y) > 0.1) {
        this.trail.add(this.pose.x, this.pose.y);
      }
      this.showScan(news.scanPose, news.ranges, news.joined, true);
      const legs = Math.max(0, this.trail.places.length / 2 - 1);
      this.trail.show(legs, this.pose);
      this.obstacles.show(news.obstacles);
      this.inset.show(this.pose, this.trail, legs, this.beamsSeen(), true, this.obstacles);
      this.say(news.time);
    },

    // Called from Python: what the driven robot does and sees.
    state(news) {
      if (this.loading) {
        // The map and the start are sent once; they wait until the page can show them.
        const { map = null, fresh = false } = this.early ?? {};
        this.early = { ...news, map: news.map ?? map, fresh: news.fresh || fresh };
        return;
      }
      if (news.fresh) {
        this.trail.set([news.pose.x, news.pose.y]);
        this.showMap({ segments: [], colours: [], tops: [], objects: 0 });
        this.pose = news.pose;
        this.choose(this.view);
      }
      this.news = { ...news, ranges: news.ranges.map((range) => range ?? Infinity) };
      this.bumped = news.bumped;
      if (news.map) this.showMap(news.map);
    },

    showScan(pose, ranges, joined, on, darkness) {
      this.beams.group.visible = on;
      const hits = ranges.filter((range) => Number.isFinite(range));
      const nearest = hits.length ? hits.reduce((a, b) => Math.min(a, b)).toFixed(2) + " m" : "none";
      this.beamText = on
        ? `${hits.length} / ${ranges.length} beams hit, min ${nearest}`
        : "beams off";
      if (on) this.beams.show(pose, ranges, joined, this.pose, darkness);
    },

    showMap({ segments, colours, tops, objects }) {
      this.bands.show(segments, colours, tops);
      this.inset.setMap(segments, colours);
      const count = segments.length / 4;
      this.mapText = `${count} segment${count === 1 ? "" : "s"} in ${objects} object${objects === 1 ? "" : "s"}`;
    },

    beamsSeen() {
      return { ends: this.beams.ends, reach: this.setup.laser.reach };
    },

    sayApart([x, y]) {
      const apart = Math.hypot(x - this.pose.x, y - this.pose.y);
      this.apart = this.setup.replay.knowsTruth ? `${apart.toFixed(2)} m off` : "";
    },

    say(time) {
      const { pose } = this;
      const [x, y] = this.setup.origin;
      const turn = (180 / Math.PI) * pose.theta;
      this.words = {
        t: time.toFixed(1),
        v: rounded(pose.speed, 2),
        w: rounded((180 / Math.PI) * pose.turning, 0),
        x: rounded(x + pose.x, 2),
        y: rounded(y + pose.y, 2),
        theta: rounded(turn - 360 * Math.round(turn / 360), 1),
        beams: this.beamText,
        map: this.mapText ?? "no map yet",
        apart: this.apart,
      };
    },

    choose(name) {
      this.view = name;
      this.rig.choose(name, this.pose);
      this.beams.ahead = name === "first";
      // Where the whole is seen, marks would be too thin; from straight above, roofs would hide them.
      const above = name === "top";
      const width = above || name === "orbit" ? this.setup.size / 250 : 0;
      this.trail.lift(width, above);
      this.estimate?.lift(0.5 * width, above);
      this.bands.lift(1.4 * width, above);
      this.shownTime = null;
    },

    use(tool) {
      if (tool === "full") toggleFullScreen();
      else if (tool === "list") this.listed = !this.listed;
      else {
        this.stage.render(this.view);
        savePicture(this.stage.canvas, `${this.setup.title}_${this.words.t}s.png`);
      }
    },

    toggle() {
      if (!this.playing && this.time >= this.end) this.time = 0;
      this.playing = !this.playing;
    },

    again() {
      this.$emit("again");
    },

    clock(seconds) {
      const whole = Math.floor(seconds);
      return `${Math.floor(whole / 60)}:${String(whole % 60).padStart(2, "0")}`;
    },

    key(event) {
      if (event.ctrlKey || event.metaKey || event.altKey) return;
      const down = event.type === "keydown";
      const way = KEYS[event.code];
      if (!this.run && way) {
        event.preventDefault();
        this.hold(way, down);
      } else if (down && event.code === "KeyV") {
        this.choose(VIEWS[(VIEWS.indexOf(this.view) + 1) % VIEWS.length]);
      } else if (down && !event.repeat && TOOLS.some((tool) => event.code === "Key" + tool.key)) {
        this.use(TOOLS.find((tool) => event.code === "Key" + tool.key).name);
      } else if (down && this.run) {
        this.playKey(event);
      }
    },

    playKey(event) {
      const skip = { ArrowLeft: -STEP, ArrowRight: STEP, Home: -Infinity, End: Infinity }[event.code];
      // A button or slider that has the focus answers to these keys itself.
      if (document.activeElement?.closest?.(".lrf3d-bar")) document.activeElement.blur();
      if (event.code === "Space") this.toggle();
      else if (skip) this.time = Math.min(this.end, Math.max(0, this.time + skip));
      else return;
      event.preventDefault();
    },

    hold(way, down, event) {
      if (event) event.target.setPointerCapture(event.pointerId);
      if (this.held[way] === down) return;
      this.held[way] = down;
      const { ahead, back, left, right } = this.held;
      this.$emit("drive", { forward: ahead - back, turn: left - right });
    },
  },
};
