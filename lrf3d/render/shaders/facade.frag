in vec3 way;
in vec2 cell;
in float under;
flat in vec2 room;
flat in vec3 wall;
flat in vec3 light;
flat in vec4 style;
flat in vec2 ends;
out vec4 colour;

const vec3 SKYLIGHT = 0.68 * vec3(0.95, 0.98, 1.06);
const float PLINTH = 0.45;  // height of the darker foot [m]

void main() {
    vec2 id = floor(cell);
    vec2 at = cell - id;
    vec2 pixel = max(fwidth(cell), vec2(1e-4));
    vec2 sharp = 1.0 / pixel;
    float seed = style.w;
    bool door = id.y < 0.5 && id.x == style.z;
    vec2 half_size = door ? vec2(0.55, 1.1) / room : style.xy;
    vec2 inside = half_size - abs(at - vec2(0.5, door ? half_size.y : 0.53));
    // How much of the pixel lies in a box, with soft edges one pixel wide.
    vec2 cover = clamp(inside * sharp + 0.5, 0.0, 1.0);
    vec2 rim = clamp((inside + 0.07 / room) * sharp + 0.5, 0.0, 1.0);
    float glass = cover.x * cover.y;
    float frame = rim.x * rim.y;
    // A cross bar, gone where it would be thinner than half a pixel; doors have none.
    float bar = door ? 0.0 : 0.03 / room.x;
    glass *= 1.0 - clamp((bar - abs(at.x - 0.5)) * sharp.x + 0.5, 0.0, 1.0) * min(2.0 * bar * sharp.x, 1.0) * 0.8;
    vec3 pane = mix(vec3(0.20, 0.27, 0.38), vec3(0.42, 0.53, 0.68), 0.65 * chance(id + seed * 91.0) + 0.35 * at.y);
    vec3 wood = fract(seed * 5.0) < 0.5 ? vec3(0.30, 0.20, 0.15) : vec3(0.16, 0.24, 0.22);
    pane = door ? wood : pane;
    // Far away a window is smaller than a pixel; then the wall takes its mean colour.
    float blur = clamp(1.6 * max(pixel.x, pixel.y) - 0.5, 0.0, 1.0);
    bool rooms = cell.y < ends.x;
    frame = rooms ? mix(frame, 0.42, blur) : 0.0;
    glass = rooms ? mix(glass, 0.34, blur) : 0.0;
    vec3 result = mix(mix(wall, 0.55 * wall + 0.4185, frame), pane, glass);
    float height = cell.y * room.y;
    float foot = 1.0 / (1.0 + 1.1 * height * (1.0 + height));
    float shade = 1.0 - 0.22 * foot + (cell.y >= ends.y ? 0.10 : 0.0) - (height <= PLINTH ? 0.14 : 0.0);
    // In the shade, the sky alone gives light; the sun's rim is some centimetres wide.
    float shaded = clamp(under / (fwidth(under) + 0.04) + 0.5, 0.0, 1.0);
    result *= mix(light, SKYLIGHT, shaded) * shade;
    float far = dot(way, way);
    colour = vec4(mix(result, haze.rgb, far / (1.0 + far)), 1.0);
}
