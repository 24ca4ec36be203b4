in vec2 uv;
in vec3 way;
uniform sampler2D picture;
uniform vec4 area;
out vec4 colour;
void main() {
    vec2 past = max(abs(uv - 0.5) - 0.5, 0.0) / area.zw;
    float share = min((past.x + past.y) / BEYOND.a, 1.0);
    // What is painted at the rim, such as a line, fades into the mean of what is around it.
    vec4 seen = texture(picture, uv, 4.0 * min(16.0 * share, 1.0));
    float cover = 4.0 * seen.a - 1.0;
    float paint = BARE + dot(clamp(vec4(-cover, cover, cover - 1.0, cover - 2.0), 0.0, 1.0), PAINTS);
    colour = vec4(hazed(mix(paint * seen.rgb, BEYOND.rgb, share), way * thick), 1.0);
}
