// Translucent triangles, a little over what they lie on.
#ifdef VERTEX
layout(location = 0) in vec3 position;
layout(location = 1) in vec4 tint;
out vec4 paint;
void main() {
    paint = tint;
    gl_Position = raised(position, nearer > 1e3 ? nearer : 0.02);
}
#else
in vec4 paint;
out vec4 colour;
void main() {
    colour = paint;
}
#endif
