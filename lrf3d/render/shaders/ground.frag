in vec2 uv;
in vec3 way;
uniform sampler2D picture;
uniform vec4 paints;    // how bright bare ground is, and what marks, kerbs and pavements add
uniform float edge;     // how much sharper than the picture edges are at 1 m
out vec4 colour;
void main() {
    vec4 seen = texture(picture, uv, -SHARPNESS);
    float away = dot(way, way);
    // Seen from near, edges between texels are as sharp as pixels.
    float sharp = clamp(edge / away, 1.0, 32.0);
    // -1 is a mark, 0 bare ground, 1 a kerb and 2 a pavement.
    float cover = 3.0 * seen.a - 1.0;
    vec3 parts = clamp((vec3(-cover, cover, cover - 1.0) - 0.5) * sharp + 0.5, 0.0, 1.0);
    float paint = paints.x + dot(parts, paints.yzw);
    float far = away * haze.a * haze.a;
    colour = vec4(mix(paint * seen.rgb, haze.rgb, far / (1.0 + far)), 1.0);
}
