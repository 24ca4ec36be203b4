layout(location = 0) in vec3 position;
layout(location = 1) in vec3 tint;
layout(location = 2) in vec2 side;      // where the wall's face looks, or 0
uniform float focus;        // pixels that a metre takes at a distance of one metre
uniform float nearer;       // how much nearer to the eye its depth is [m]
uniform vec3 sizes;         // diameter [m], smallest and largest [pixels]
out vec3 paint;
out float diameter;
void main() {
    paint = tint;
    gl_Position = raised(position, nearer);
    if (!shown(position, side, nearer)) gl_Position.z = 2.0 * gl_Position.w;
    diameter = clamp(sizes.x * focus / gl_Position.w, sizes.y, sizes.z);
    gl_PointSize = POINT_HALO * diameter + 1.0;
}
