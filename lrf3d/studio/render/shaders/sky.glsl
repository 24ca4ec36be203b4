// The sky, computed at the corners of a mesh: it is smooth, and pixels are many.
#ifdef VERTEX
layout(location = 0) in vec2 corner;
uniform mat4 ray_from_corner;
out vec3 sky;
void main() {
    vec4 far = ray_from_corner * vec4(corner, 1.0, 1.0);
    vec3 look = normalize(far.xyz / far.w - eye);
    sky = mix(HAZE, ZENITH, 1.0 - pow(1.0 - clamp(look.z, 0.0, 1.0), 2.6));
    gl_Position = vec4(corner, 1.0, 1.0);
}
#else
in vec3 sky;
out vec4 colour;
void main() {
    colour = vec4(sky, 1.0);
}
#endif
