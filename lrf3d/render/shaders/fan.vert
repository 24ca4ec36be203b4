layout(location = 0) in vec3 position;
layout(location = 1) in vec2 distance_and_share;
uniform float reach;    // distance [m] at which nothing of the fan is left
uniform float strength;
out float left;
out float share;
void main() {
    left = 1.0 - distance_and_share.x / reach;
    share = strength * distance_and_share.y;
    gl_Position = view_projection * vec4(position, 1.0);
}
