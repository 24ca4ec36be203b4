in vec3 paint;
in float diameter;
out vec4 colour;
void main() {
    vec2 at = (gl_PointCoord - 0.5) * (diameter + 1.0);
    float cover = clamp(0.5 * diameter + 0.5 - length(at), 0.0, 1.0);
    float shade = 1.0 - 0.30 * smoothstep(0.15, 0.5, length(at) / diameter);
    colour = vec4(paint * shade, cover);
}
