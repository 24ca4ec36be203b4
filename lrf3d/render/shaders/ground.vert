layout(location = 0) in vec2 corner;
out vec2 place;
void main() {
    place = corner;
    gl_Position = view_projection * vec4(corner, 0.0, 1.0);
}
