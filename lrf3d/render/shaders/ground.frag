in vec2 uv;
in vec3 way;
uniform sampler2D picture;
uniform mat4 paints;    // asphalt or the floor's edge, and what marks, kerbs and pavements change
uniform float edge;     // how much sharper than the picture edges are at 1 m
out vec4 colour;
void main() {
    vec4 seen = texture(picture, uv, -SHARPNESS);
    float away = dot(way, way);
    vec3 paint = paints[0].rgb;
    // -1 is a mark, 0 bare ground, of which there is most, 1 a kerb and 2 a pavement.
    float cover = 3.0 * seen.a - 1.0;
    if (abs(cover) > 0.02) {
        // Seen from near, edges between texels are as sharp as pixels.
        float sharp = clamp(edge / away, 1.0, 32.0);
        vec3 share = clamp((vec3(-cover, cover, cover - 1.0) - 0.5) * sharp + 0.5, 0.0, 1.0);
        paint += mat3(paints[1].rgb, paints[2].rgb, paints[3].rgb) * vec3(-share.x, share.yz);
    }
    float far = away * haze.a * haze.a;
    colour = vec4(mix(paint * seen.rgb, haze.rgb, far / (1.0 + far)), 1.0);
}
