// Walls and roofs. Some are seen through: what was never seen becomes glass at the end, and what
// hides the robot is open. Then SOLID ones are drawn, and after all else the rest as a VEIL. What is
// not needed is left out: each value takes time for each pixel.
uniform float cut;          // height that walls are cut at [m]
uniform vec2 clock;         // what time it is [lengths of the run], and the film's seconds in one
#if defined(SOLID) || defined(VEIL)
#define OPENED
#endif
#ifdef VERTEX
layout(location = 0) in vec3 position;
layout(location = 1) in vec3 colour;
layout(location = 2) in vec3 before;
uniform vec4 grid;          // lower left corner of the picture of times [m], one over its size [1/m]
out vec4 paint;             // colour, and whether this is a wall: roofs are never seen
out vec4 foot;              // places in the picture of times, and in that of the map
out float height;           // [m]
#if defined(OPENED) || defined(MIRRORED)
out vec3 from_eye;
#endif
void main() {
    paint = vec4(colour, before.z);
    vec3 place = vec3(position.xy, min(position.z, cut));
    vec2 mapped = before.z > 0.5 ? position.xy : before.xy;
    foot = (vec4(before.xy, mapped) - grid.xyxy) * grid.zwzw;
    height = place.z;
#if defined(OPENED) || defined(MIRRORED)
    from_eye = place - eye;
#endif
    gl_Position = view_projection * vec4(place, 1.0);
}
#else
in vec4 paint;
in vec4 foot;
in float height;
#if defined(OPENED) || defined(MIRRORED)
in vec3 from_eye;
#endif
uniform sampler2D times;
uniform sampler2D tints;
out vec4 colour;
#ifdef OPENED
uniform float glass;        // how far what was never seen has become glass
uniform vec3 robot;
// How much is left of what is so lit: in a cone of even size in the picture the robot is seen.
float opacity(float on) {
    if (glass > 0.0) return on < 0.5 ? 1.0 - glass * GHOST_STRENGTH : 1.0;
    vec3 toward = robot - eye;
    float reach = length(toward);
    float along = dot(from_eye, toward) / reach;
    float off = length(from_eye - along / reach * toward) / max(along, 0.1);
    return 1.0 - VEIL_SHARE * (1.0 - smoothstep(0.55 * PEEP, PEEP, off)) * step(along, reach - 1.0);
}
#endif

void main() {
#ifdef MIRRORED
    through_mirror(from_eye);
#endif
    vec4 when = texture(times, foot.xy);
    float since = age(when, clock);
    // Walls that are cut are filled, as architects draw them, once what is beside them is seen.
    float on = mix(TOP_LIT, 1.0, paint.a) * lit(when, since);
    float left = 1.0;
#ifdef OPENED
    left = opacity(on);
#ifdef VEIL
    if (left >= 1.0) discard;
#else
    if (left < 1.0) discard;
#endif
#endif
    vec3 seen = exposed(paint.rgb, on, since, height);
    // The colour of the map climbs up a wall that it has.
    vec4 map = texture(tints, foot.zw);
    float climbed = (clock.x - when.b) * clock.y * CLIMB - height;
    float found = clamp(1.5 * climbed + 0.5, 0.0, 1.0) * mix(1.0, min(2.0 * when.g, 1.0), paint.a);
    float share = found * mix(ROOF_SHARE, MAP_SHARE, paint.a);
    float front = 0.5 * paint.a * found * clamp(1.0 - climbed / FRONT, 0.0, 1.0);
    seen += map.rgb * (share * (MAP_LIGHT.x + MAP_LIGHT.y * grey(paint.rgb)) + front) - seen * (share * map.a);
    seen = hazed(seen);
#ifdef MIRRORED
    seen *= REFLECTED;
#endif
#ifdef VEIL
    seen = mix(seen, HAZE, glass);
#endif
    colour = vec4(seen, left);
}
#endif
