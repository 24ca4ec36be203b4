layout(location = 0) in vec3 position;
layout(location = 1) in float distance_out;
out float range;
void main() {
    range = distance_out;
    gl_Position = view_projection * vec4(position, 1.0);
}
