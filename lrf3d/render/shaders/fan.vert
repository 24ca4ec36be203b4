layout(location = 0) in vec3 position;
layout(location = 1) in vec2 distance_and_share;
out float range;
out float share;
void main() {
    range = distance_and_share.x;
    share = distance_and_share.y;
    gl_Position = view_projection * vec4(position, 1.0);
}
