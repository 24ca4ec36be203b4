in vec3 way;
in float under;
flat in vec3 wall;
in vec3 light;
in vec3 shade;
out vec4 colour;
void main() {
    // The rim of the sun's light is some centimetres wide.
    float shadowed = clamp(under / (fwidth(under) + RIM) + 0.5, 0.0, 1.0);
    vec3 result = wall * mix(light, shade, shadowed);
    colour = vec4(hazed(result, way), 1.0);
}
