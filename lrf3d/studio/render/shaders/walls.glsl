// Walls and roofs. What is not needed is left out: each value takes time for each pixel.
uniform float cut;          // height that walls are cut at [m]
uniform vec2 clock;         // what time it is [lengths of the run], and the film's seconds in one
#ifdef VERTEX
layout(location = 0) in vec3 position;
layout(location = 1) in vec3 colour;
layout(location = 2) in vec3 before;
layout(location = 3) in vec4 skin;
uniform vec4 grid;          // lower left corner of the picture of times [m], one over its size [1/m]
out vec4 paint;             // colour, and whether this is a wall: roofs are never seen
out vec4 foot;              // places in the picture of times, and in that of the map
out float height;           // [m]
out float along;            // where on its wall this is [m]
flat out vec3 wall;         // length and height of that [m], and what it shows
#ifdef MIRRORED
out vec3 from_eye;
#endif
void main() {
    paint = vec4(colour, before.z);
    vec3 place = vec3(position.xy, min(position.z, cut));
    vec2 mapped = before.z > 0.5 ? position.xy : before.xy;
    foot = (vec4(before.xy, mapped) - grid.xyxy) * grid.zwzw;
    height = place.z;
    along = skin.x;
    wall = skin.yzw;
#ifdef MIRRORED
    from_eye = place - eye;
#endif
    gl_Position = view_projection * vec4(place, 1.0);
}
#else
in vec4 paint;
in vec4 foot;
in float height;
in float along;
flat in vec3 wall;
#ifdef MIRRORED
in vec3 from_eye;
#endif
uniform sampler2D times;
uniform sampler2D tints;
out vec4 colour;
// How much of a pixel lies within half a width of the middle of a strip [m].
float strip(float off, float half_width, float pixel) {
    return clamp(0.5 + (half_width - abs(off)) / pixel, 0.0, 1.0);
}

// Storeys with windows, a door on each side of a house, and shops in some.
vec3 facade(vec3 day, float own, vec2 pixel, inout float keeps) {
    float storeys = floor((wall.y + 0.5) / STOREY), level = floor(height / STOREY);
    float v = height - level * STOREY;
    float bays = floor(wall.x / (2.5 + own) + 0.35);
    if (bays < 0.5 || storeys < 0.5) return day;
    float bay = wall.x / bays, number = floor(along / bay), u = along - (number + 0.5) * bay;
    // What is finer than a pixel goes over to its mean.
    float near = clamp(1.6 - 2.2 * max(pixel.x / bay, pixel.y / STOREY), 0.0, 1.0);
    day *= 1.0 + 0.10 * strip(height - wall.y, 0.30, pixel.y);
    if (level >= storeys) return day;
    bool low = level < 0.5;
    bool door = low && number == floor(fract(own * 7.3 + 0.37) * bays);
    bool shop = low && own > 0.5;
    float wide = door ? 0.52 : shop ? 0.5 * bay - 0.35 : min(0.40 + 0.35 * own, 0.5 * bay - 0.3);
    float base = door ? 0.0 : shop ? 0.55 : 0.95, top = door ? 2.15 : 2.42;
    float middle = 0.5 * (base + top), high = 0.5 * (top - base);
    float frame = strip(u, wide + 0.12, pixel.x) * strip(v - middle, high + 0.12, pixel.y);
    float pane = strip(u, wide, pixel.x) * strip(v - middle, high, pixel.y);
    // A bar parts the pane.
    float bar = door ? 0.0 : strip(u, 0.035, pixel.x) * clamp(0.05 / pixel.x, 0.0, 1.0);
    vec3 dark = door ? vec3(0.44, 0.33, 0.25) : vec3(0.22, 0.27, 0.34);
    day = mix(day, day * 1.10, frame * near);
    day = mix(day, day * dark, pane * (1.0 - 0.75 * bar));
    keeps = 1.0 - 0.25 * pane * near;
    return day;
}

// A skirting, and frames where a wall ends free.
vec3 room_wall(vec3 day, float kind, vec2 pixel, inout float keeps) {
    bool starts = kind == 3.0 || kind == 5.0, ends = kind > 3.5;
    float off = min(starts ? along : 9.0, ends ? wall.x - along : 9.0);
    float frame = clamp(0.5 + (0.09 - off) / pixel.x, 0.0, 1.0);
    float board = clamp(0.5 + (0.085 - height) / pixel.y, 0.0, 1.0);
    day = mix(day, day * vec3(0.60, 0.55, 0.50), board);
    keeps = 1.0 - 0.7 * frame;
    return mix(day, day * vec3(0.62, 0.48, 0.36), frame);
}

// A rack: posts, shelves, and boxes on pallets, each of its own width and height.
vec3 rack(vec3 day, float own, vec2 pixel, inout float keeps) {
    float bays = floor(wall.x / 1.35 + 0.5), bay = wall.x / bays, number = floor(along / bay);
    float u = along - (number + 0.5) * bay, level = floor(height / SHELF), v = height - level * SHELF;
    float chance = fract(sin(dot(vec2(number, level + 7.0 * own), vec2(12.99, 78.23))) * 4375.5);
    float wide = 0.5 * bay * (0.62 + 0.28 * chance), high = SHELF * (0.55 + 0.33 * fract(7.0 * chance));
    float box = strip(u, wide, pixel.x) * strip(v - 0.5 * high - 0.05, 0.5 * high - 0.05, pixel.y);
    box *= step(0.12, chance);
    vec3 card = vec3(0.62, 0.50, 0.36) * (0.75 + 0.4 * fract(3.0 * chance));
    float near = clamp(1.6 - 2.2 * max(pixel.x / bay, pixel.y / SHELF), 0.0, 1.0);
    vec3 filled = mix(day * 0.30, card * (0.2 + 1.6 * grey(day)), box);
    filled *= 1.0 - 0.15 * strip(u, 0.03, pixel.x) * box;
    float steel = max(strip(v, 0.055, pixel.y), strip(abs(u) - 0.5 * bay, 0.045, pixel.x));
    keeps = 1.0 - 0.85 * near * box * (1.0 - steel);
    return mix(day * 0.8, mix(filled, day * 1.05, steel), near);
}

// A cupboard: a base, doors, and a top that stands out.
vec3 cupboard(vec3 day, vec2 pixel) {
    float parts = max(1.0, floor(wall.x / 0.62)), part = wall.x / parts;
    float u = along - (floor(along / part) + 0.5) * part, top = min(wall.y, cut);
    float joint = max(strip(abs(u) - 0.5 * part, 0.008, pixel.x), strip(height - 0.55 * wall.y, 0.008, pixel.y));
    float board = clamp(0.5 + (height - top + 0.05) / pixel.y, 0.0, 1.0);
    day *= 1.0 - 0.45 * clamp(0.5 + (0.09 - height) / pixel.y, 0.0, 1.0);
    day *= 1.0 - 0.4 * joint * (1.0 - board);
    return day * (1.0 + 0.12 * board);
}

// A wall with what gives it scale.
vec3 dressed(vec3 day, inout float keeps) {
    float kind = floor(wall.z), own = fract(wall.z);
    if (kind < 0.5) return day;
    vec2 pixel = max(fwidth(vec2(along, height)), vec2(1e-4));
    // Little light gets to the foot of a wall.
    float low = clamp(1.0 - height / (TOP_LIT == 0.0 ? 0.9 : 0.22), 0.0, 1.0);
    day *= 1.0 - 0.42 * low * low;
    // Only in towns no light falls on tops. All branches would be computed for each pixel, were
    // this not a constant.
    if (TOP_LIT == 0.0) return facade(day, own, pixel, keeps);
    if (kind < 5.5) return room_wall(day, kind, pixel, keeps);
    if (wall.y > 1.3 && wall.x > 3.5) return rack(day, own, pixel, keeps);
    return wall.x > 0.5 ? cupboard(day, pixel) : day;
}

void main() {
#ifdef MIRRORED
    through_mirror(from_eye);
#endif
    vec4 when = texture(times, foot.xy);
    float since = age(when, clock);
    // Walls that are cut are filled, as architects draw them, once what is beside them is seen.
    float most = mix(TOP_LIT, 1.0, paint.a);
    float on = most * lit(when, since);
    float keeps = 1.0;      // How far it takes the colour of the map.
    vec3 day = on > 0.0 ? dressed(paint.rgb, keeps) : paint.rgb;
    vec3 seen = exposed(day, paint.rgb, on, since, height);
    // The colour of the map climbs up a wall that it has.
    vec4 map = texture(tints, foot.zw);
    float climbed = (clock.x - when.b) * clock.y * CLIMB - height;
    float found = clamp(1.5 * climbed + 0.5, 0.0, 1.0) * mix(1.0, min(2.0 * when.g, 1.0), paint.a);
    float share = keeps * found * mix(TOP_TINT * TOP_LIT, 1.0, paint.a) * MAP_SHARE;
    float front = 0.5 * paint.a * found * clamp(1.0 - climbed / FRONT, 0.0, 1.0);
    seen += map.rgb * (share * (MAP_LIGHT.x + MAP_LIGHT.y * grey(day)) + front) - seen * (share * map.a);
    seen = hazed(seen);
#ifdef MIRRORED
    seen *= REFLECTED;
#endif
    colour = vec4(seen, 1.0);
}
#endif
