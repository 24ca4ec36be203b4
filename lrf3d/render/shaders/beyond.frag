in vec2 uv;
in vec3 way;
uniform sampler2D picture;
uniform mat4 paints;    // asphalt or the floor's edge, and what marks, kerbs and pavements change
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
    vec3 paint = paints[0].rgb
        + mat3(paints[1].rgb, paints[2].rgb, paints[3].rgb) * vec3(-parts.x, parts.yz);
    vec3 ground = mix(paint * seen.rgb, beyond.rgb, share);
    float far = dot(way, way) * haze.a * haze.a;
    colour = vec4(mix(ground, haze.rgb, far / (1.0 + far)), 1.0);
}
