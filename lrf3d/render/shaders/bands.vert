layout(location = 0) in vec2 before;
layout(location = 1) in vec2 after;
layout(location = 2) in vec3 off;       // off the middle: to the side, and up
layout(location = 3) in vec2 heights;   // of the middle and of the wall [m]
layout(location = 4) in vec4 tint;
uniform float grown;    // share of the way that walls have grown since the map before
uniform vec3 band;      // half its thickness and height [m], and the least half height at 1 m [m]
out vec4 paint;
out vec3 way;           // from the eye, in units of the haze
void main() {
    vec2 place = mix(before, after, grown);
    float away = (view_projection * vec4(place, heights.x, 1.0)).w;
    float size = max(1.0, band.z * away / band.y);
    float up = clamp(heights.x + off.z * band.y * size, 0.02, heights.y);
    vec3 world = vec3(place + off.xy * band.x * min(size, 3.0), up);
    paint = tint;
    way = (world - eye) * thick;
    gl_Position = view_projection * vec4(world, 1.0);
}
