// Walls and roofs. PLAIN ones have nothing painted on them; FADED ones become ghosts. What is not
// needed is left out: each value takes time for each pixel.
uniform float ghost;        // how far they have faded
uniform float cut;          // height that walls are cut at [m]
#ifdef VERTEX
layout(location = 0) in vec3 position;
layout(location = 1) in vec3 painted;
layout(location = 2) in vec3 colour;
layout(location = 3) in vec3 bright;
layout(location = 4) in vec3 shaded;
layout(location = 5) in float under_shadow;
out vec3 way;               // from the eye, in units of the haze
out vec2 texel;             // along and up the texture
out float under;            // how far under the edge of its shadow [m]
flat out float layer;
flat out vec3 wall;         // colour of the wall
out vec3 light;             // how much of each colour the face gets in the sun
out vec3 shade;             // and where the sun is hidden
void main() {
    texel = painted.xy * TILE;
    layer = painted.z;
    wall = colour;
    light = bright;
    shade = shaded;
    under = under_shadow;
    vec3 place = vec3(position.xy, min(position.z, cut));
    way = (place - eye) * thick;
    gl_Position = view_projection * vec4(place, 1.0);
}
#else
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

vec4 painted() {
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
    return textureLod(picture, vec3(at / SIZE, copy), float(level));
}

void main() {
    // The rim of the sun's light is some centimetres wide.
    float shadowed = clamp(under / (fwidth(under) + RIM) + 0.5, 0.0, 1.0);
#ifdef PLAIN
    vec3 result = wall;
#else
    vec4 paint = painted();
    vec3 result = wall * paint.a + paint.rgb;
#endif
    vec3 seen = hazed(result * mix(light, shade, shadowed), way);
#ifdef FADED
    colour = vec4(mix(seen, GHOST.rgb, ghost), 1.0 - ghost * GHOST.a);
#else
    colour = vec4(seen, 1.0);
#endif
}
#endif
