layout(location = 0) in vec2 position;
layout(location = 1) in vec4 tint;
uniform mat4 place;
out vec4 paint;
void main() {
    paint = tint;
    gl_Position = view_projection * place * vec4(position, 0.0, 1.0);
}
