// Bodies, in the colours of their corners.
#ifdef VERTEX
layout(location = 0) in vec3 position;
layout(location = 1) in vec3 tint;
uniform mat4 pose;
out vec3 from_eye;
out vec3 paint;
void main() {
    vec4 place = pose * vec4(position, 1.0);
    from_eye = place.xyz - eye;
    paint = tint;
    gl_Position = view_projection * place;
}
#else
in vec3 from_eye;
in vec3 paint;
out vec4 colour;
void main() {
    colour = vec4(hazed(paint), 1.0);
#ifdef MIRRORED
    through_mirror(from_eye);
    colour.rgb *= REFLECTED;
#endif
}
#endif
