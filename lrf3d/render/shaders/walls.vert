layout(location = 0) in vec3 position;
layout(location = 1) in vec3 normal;
layout(location = 2) in vec2 along_up;
layout(location = 3) in vec2 extent;
layout(location = 4) in vec4 colour_kind;
layout(location = 5) in float under_shade;
out vec3 way;               // from the eye, in units of the haze
out float height;           // above the foot of the face [m]
out float under;            // how far under the edge of its shade [m]
flat out vec3 wall;         // colour
flat out vec3 skirting;     // colour of the foot
flat out vec4 foot;         // how high the foot is [m], the shade above it and how fast that ends, and
                            // what is left of the light in the shade of others
const float SKYLIGHT = 0.68;
void main() {
    // All that is the same on the whole face is reckoned here, and not for each pixel.
    float kind = floor(colour_kind.a);
    vec3 paint = colour_kind.rgb;
    float bright = dot(normal, sun);
    float light = 0.73 + 0.52 * max(bright, 0.0) + 0.10 * min(bright, 0.0);
    foot = vec4(-1e9, 0.0, 0.0, SKYLIGHT);
    if (kind < 1.5) {
        light = mix(light, 0.90 + 0.16 * bright, indoor);
        foot = vec4(indoor > 0.5 ? 0.09 : 0.0, 0.16, 3.5, SKYLIGHT / light);
    } else if (kind < 2.5) {
        paint = indoor > 0.5 ? paint * 1.02 : mix(paint, vec3(0.52, 0.52, 0.53), 0.75);
        light = indoor > 0.5 ? 1.0 : 1.08;
    } else {
        paint *= indoor > 0.5 ? 0.55 : 0.85;
        light = 1.0;
    }
    wall = paint * light;
    skirting = wall * 0.62;
    height = along_up.y;
    under = under_shade;
    way = (position - eye) * haze.a;
    gl_Position = view_projection * vec4(position, 1.0);
}
