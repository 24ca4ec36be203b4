in vec2 uv;
in vec3 way;
uniform sampler2D picture;
uniform mat4 paints;        // colours of ground, kerb, pavement and marks
uniform vec3 shade_tint;    // colours of the brightest light without the sun, and with it
uniform vec3 lit_tint;
uniform vec4 area;
uniform vec4 beyond;    // colour of the ground past the picture, and width of the change [m]
out vec4 colour;
void main() {
    vec2 past = max(abs(uv - 0.5) - 0.5, 0.0) / area.zw;
    float share = min((past.x + past.y) / beyond.a, 1.0);
    // What is painted at the rim, such as a line, fades into the mean of what is around it.
    vec4 seen = texture(picture, uv, 4.0 * min(16.0 * share, 1.0));
    vec2 cover = vec2(min(2.0 * seen.r, 1.0), max(2.0 * seen.r - 1.0, 0.0));
    vec3 paint = mix(mix(paints[0].rgb, paints[1].rgb, cover.x), paints[2].rgb, cover.y);
    paint = mix(paint, paints[3].rgb, seen.g) * mix(shade_tint, lit_tint, seen.a) * seen.b;
    vec3 ground = mix(paint, beyond.rgb, share);
    float far = dot(way, way);
    colour = vec4(mix(ground, haze.rgb, far / (1.0 + far)), 1.0);
}
