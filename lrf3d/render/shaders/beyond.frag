in vec2 uv;
in vec3 way;
uniform sampler2D picture;
uniform vec4 paints;    // how bright bare ground is, and what marks, kerbs and pavements add
uniform vec4 area;
uniform vec4 beyond;    // colour of the ground past the picture, and width of the change [m]
out vec4 colour;
void main() {
    vec2 past = max(abs(uv - 0.5) - 0.5, 0.0) / area.zw;
    float share = min((past.x + past.y) / beyond.a, 1.0);
    // What is painted at the rim, such as a line, fades into the mean of what is around it.
    vec4 seen = texture(picture, uv, 4.0 * min(16.0 * share, 1.0));
    float cover = 3.0 * seen.a - 1.0;
    vec3 parts = clamp(vec3(-cover, cover, cover - 1.0), 0.0, 1.0);
    float paint = paints.x + dot(parts, paints.yzw);
    float far = dot(way, way) * haze.a * haze.a;
    colour = vec4(mix(mix(paint * seen.rgb, beyond.rgb, share), haze.rgb, far / (1.0 + far)), 1.0);
}
