layout(location = 0) in vec2 corner;
uniform vec4 box;       // left, top, right, bottom in the picture's −1…1
out vec2 uv;
void main() {
    uv = corner;
    gl_Position = vec4(mix(box.xy, box.zw, corner), 0.0, 1.0);
}
