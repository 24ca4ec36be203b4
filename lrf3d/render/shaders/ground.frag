in vec2 uv;
in vec3 way;
uniform sampler2D picture;
uniform float edge;     // how much sharper than the picture edges are at 1 m
out vec4 colour;
void main() {
#ifdef NEAR
    // Nowhere is a smaller copy of the picture wanted, and to know that beforehand saves time.
    vec4 seen = textureLod(picture, uv, 0.0);
#else
    vec4 seen = texture(picture, uv, -SHARPNESS);
#endif
    float away = dot(way, way);
    // Seen from near, edges between texels are as sharp as pixels.
    float sharp = clamp(edge / away, 1.0, 32.0);
    // -1 is a mark, 0 bare ground, 1 a kerb, 2 a pavement and 3 a lawn.
    float cover = 4.0 * seen.a - 1.0;
    vec4 parts = clamp((vec4(-cover, cover, cover - 1.0, cover - 2.0) - 0.5) * sharp + 0.5, 0.0, 1.0);
    float paint = BARE + dot(parts, PAINTS);
    colour = vec4(hazed(paint * seen.rgb, way * thick), 1.0);
}
