layout(location = 0) in vec2 corner;
uniform vec4 box;       // left, top, right, bottom in the picture's −1…1
void main() {
    // Nothing is nearer, and so nothing is drawn there after it.
    gl_Position = vec4(mix(box.xy, box.zw, corner), -1.0, 1.0);
}
