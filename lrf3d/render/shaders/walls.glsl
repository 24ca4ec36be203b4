// Walls and roofs. PLAIN ones have nothing painted on them. At the end those LIT stand, and DIM
// ones, which were never seen, become glass. What hides the robot is open (PEEP), and drawn thinly
// after all else (VEIL). What is not needed is left out: each value takes time for each pixel.
uniform float glass;        // how far what was never seen has become glass
uniform float cut;          // height that walls are cut at [m]
uniform vec2 clock;         // what time it is [lengths of the run], and the film's seconds in one
#ifdef VERTEX
layout(location = 0) in vec3 position;
layout(location = 1) in vec3 painted;
layout(location = 2) in vec3 colour;
layout(location = 3) in float bright;
layout(location = 4) in vec3 before;
uniform vec4 grid;          // lower left corner of the picture of times [m], one over its size [1/m]
out vec2 texel;             // along and up the texture
flat out float layer;
flat out vec4 wall;         // colour of the wall, and whether it is one: roofs are never seen
out float light;            // how much of it the face gets
out vec4 foot;              // places in the picture of times, and in that of the map
out float height;           // [m]
#if defined(PEEP) || defined(MIRRORED)
out vec3 from_eye;
#endif
void main() {
    texel = painted.xy * TILE;
    layer = painted.z;
    wall = vec4(colour, before.z);
    light = bright;
    vec3 place = vec3(position.xy, min(position.z, cut));
    vec2 mapped = before.z > 0.5 ? position.xy : before.xy;
    foot = (vec4(before.xy, mapped) - grid.xyxy) * grid.zwzw;
    height = place.z;
#if defined(PEEP) || defined(MIRRORED)
    from_eye = place - eye;
#endif
    gl_Position = view_projection * vec4(place, 1.0);
}
#else
in vec2 texel;
flat in float layer;
flat in vec4 wall;
in float light;
in vec4 foot;
in float height;
uniform sampler2DArray picture;
uniform sampler2D times;
uniform sampler2D tints;
#ifdef PEEP
uniform vec3 robot;
#endif
#if defined(PEEP) || defined(MIRRORED)
in vec3 from_eye;
#endif
out vec4 colour;

// The logarithm to the base of 2, rounded: read off the exponent, which costs far less than log2.
int doublings(float value) {
    return (floatBitsToInt(1.41421356 * value) >> 23) - 127;
}

vec4 painted() {
    // Texels to a pixel; a copy as coarse as that, and one blurred along the wall for the rest.
    vec2 coarse = max(fwidth(texel), 1e-4);
    // Seen from above, it may be half as coarse as a pixel is high: windows stay sharp.
    float fit = clamp(coarse.x, 0.5 * coarse.y, coarse.y);
    int level = max(doublings(max(fit, coarse.x / float(1 << (SLANTS - 1)))), 0);
    int slant = clamp(doublings(coarse.x) - level, 0, SLANTS - 1);
    // Seen from near, edges between texels are one pixel wide.
    vec2 edge = floor(texel + 0.5);
    vec2 at = edge + clamp((texel - edge) / min(coarse, 1.0), -0.5, 0.5);
    float copy = layer + (layer < float(WINDOWED) ? 0.0 : float(slant));
    return textureLod(picture, vec3(at / SIZE, copy), float(level));
}

void main() {
#ifdef MIRRORED
    through_mirror(from_eye);
#endif
#ifdef PEEP
    // What stands between the eye and the robot is open: a cone of even size in the picture.
    vec3 toward = robot - eye;
    float reach = length(toward);
    float along = dot(from_eye, toward) / reach;
    float off = length(from_eye - along / reach * toward) / max(along, 0.1);
    float open = (1.0 - smoothstep(0.55 * PEEP_WIDTH, PEEP_WIDTH, off)) * step(along, reach - 1.0);
#ifdef VEIL
    if (open <= 0.0) discard;
#else
    if (open > 0.0) discard;
#endif
#endif
    vec4 when = texture(times, foot.xy);
    float since = age(when, clock);
    float on = wall.a * lit(when, since);
#ifdef LIT
    if (on < 0.5) discard;
#endif
#ifdef DIM
    if (on >= 0.5) discard;
#endif
#ifdef PLAIN
    vec3 day = wall.rgb * light;
#else
    vec4 paint = painted();
    vec3 day = (wall.rgb * paint.a + paint.rgb) * light;
#endif
    vec3 seen = exposed(day, on, since, height);
    // The colour of the map climbs up a wall that it has.
    vec4 map = texture(tints, foot.zw);
    float climbed = (clock.x - when.b) * clock.y * CLIMB - height;
    float found = clamp(1.5 * climbed + 0.5, 0.0, 1.0) * mix(1.0, min(2.0 * when.g, 1.0), wall.a);
    float share = found * mix(ROOF_SHARE, MAP_SHARE, wall.a);
    float front = 0.5 * wall.a * found * clamp(1.0 - climbed / FRONT, 0.0, 1.0);
    seen += map.rgb * (share * (MAP_LIGHT.x + MAP_LIGHT.y * grey(day)) + front) - seen * (share * map.a);
    seen = hazed(seen);
#ifdef MIRRORED
    seen *= REFLECTED;
#endif
#ifdef VEIL
    colour = vec4(seen, 1.0 - PEEP_DEPTH * open);
#elif defined(DIM)
    colour = vec4(mix(seen, GHOST.rgb, glass), 1.0 - glass * GHOST.a);
#else
    colour = vec4(seen, 1.0);
#endif
}
#endif
