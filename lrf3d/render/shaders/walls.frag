in vec3 way;
in vec2 texel;
in float under;
flat in float layer;
flat in vec3 wall;
in vec3 light;
in vec3 shade;
uniform sampler2DArray picture;
out vec4 colour;

// The logarithm to the base of 2, rounded: read off the exponent, which costs far less than log2.
int doublings(float value) {
    return (floatBitsToInt(1.41421356 * value) >> 23) - 127;
}

void main() {
    // Texels to a pixel; a copy as coarse as that, and one blurred along the wall for the rest.
    vec2 coarse = max(fwidth(texel), 1e-4);
    // Seen from above, it may be half as coarse as a pixel is high: frames of windows stay sharp.
    float fit = clamp(coarse.x, 0.5 * coarse.y, coarse.y);
    int level = max(doublings(max(fit, coarse.x / float(1 << (SLANTS - 1)))), 0);
    int slant = clamp(doublings(coarse.x) - level, 0, SLANTS - 1);
    // Seen from near, edges between texels are one pixel wide.
    vec2 edge = floor(texel + 0.5);
    vec2 at = edge + clamp((texel - edge) / min(coarse, 1.0), -0.5, 0.5);
    float copy = layer + (layer < float(WINDOWED) ? 0.0 : float(slant));
    vec4 painted = textureLod(picture, vec3(at / SIZE, copy), float(level));
    // The rim of the sun's light is some centimetres wide.
    float shadowed = clamp(under / (fwidth(under) + RIM) + 0.5, 0.0, 1.0);
    vec3 result = (wall * painted.a + painted.rgb) * mix(light, shade, shadowed);
    colour = vec4(hazed(result, way), 1.0);
}
