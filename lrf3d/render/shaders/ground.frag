in vec2 uv;
in vec3 way;
uniform sampler2D picture;
uniform mat4 paints;        // colours of ground, kerb, pavement and marks
uniform vec3 shade_tint;    // colours of the brightest light without the sun, and with it
uniform vec3 lit_tint;
out vec4 colour;
void main() {
    vec4 seen = texture(picture, uv, -SHARPNESS);
    vec2 step = fwidth(uv) * vec2(textureSize(picture, 0));
    // Seen from near, edges between texels are as sharp as pixels.
    float sharp = clamp(2.0 / max(step.x, step.y), 1.0, 32.0);
    vec3 cover = vec3(min(2.0 * seen.r, 1.0), max(2.0 * seen.r - 1.0, 0.0), seen.g);
    cover = clamp((cover - 0.5) * sharp + 0.5, 0.0, 1.0);
    vec3 paint = mix(mix(paints[0].rgb, paints[1].rgb, cover.x), paints[2].rgb, cover.y);
    paint = mix(paint, paints[3].rgb, cover.z) * mix(shade_tint, lit_tint, seen.a) * seen.b;
    float far = dot(way, way);
    colour = vec4(mix(paint, haze.rgb, far / (1.0 + far)), 1.0);
}
