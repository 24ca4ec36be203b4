in vec3 world;
in vec2 place;          // along and up the face [m]
flat in vec3 facing;
flat in vec2 size;      // length and height of the face [m]
flat in vec4 paint;     // colour, and kind of the face with its seed as fraction
out vec4 colour;

const float BAY = 2.7;      // about the distance between windows [m]
const float STOREY = 3.1;   // about the height of a storey [m]
const float CORNICE = 0.45; // height of the band under the roof [m]

// How much of a pixel lies in a box round a middle, with soft edges one pixel wide.
float box(vec2 at, vec2 middle, vec2 half_size, vec2 pixel) {
    vec2 inside = half_size - abs(at - middle);
    vec2 cover = clamp(inside / pixel + 0.5, 0.0, 1.0);
    return cover.x * cover.y;
}

vec3 facade(vec3 wall, float seed) {
    float bays = max(1.0, floor(size.x / BAY));
    float storeys = max(1.0, floor((size.y - CORNICE) / STOREY));
    vec2 room = vec2(size.x / bays, (size.y - CORNICE) / storeys);
    vec2 cell = place / room;
    vec2 pixel = max(fwidth(cell), vec2(1e-4));
    vec2 id = floor(cell);
    vec2 at = fract(cell);
    vec3 result = wall;
    if (size.x > 1.7 && cell.y < storeys) {
        float wide = 0.24 + 0.09 * fract(seed * 7.31);
        float tall = 0.25 + 0.07 * fract(seed * 3.17);
        float lot = chance(id + seed * 91.0);
        bool door = id.y < 0.5 && bays > 1.5 && id.x == floor(seed * 0.999 * bays);
        vec2 middle = door ? vec2(0.5, 1.1 / room.y) : vec2(0.5, 0.53);
        vec2 half_size = door ? vec2(0.55, 1.1) / room : vec2(wide, tall);
        vec2 rim = vec2(0.07) / room;
        float frame = box(at, middle, half_size + rim, pixel);
        float glass = box(at, middle, half_size, pixel);
        if (!door) {
            // A cross bar, gone where it would be thinner than half a pixel.
            float bar = 0.03 / room.x;
            glass *= 1.0 - clamp((bar - abs(at.x - 0.5)) / pixel.x + 0.5, 0.0, 1.0) * clamp(2.0 * bar / pixel.x, 0.0, 1.0) * 0.8;
        }
        vec3 pane = mix(vec3(0.20, 0.27, 0.38), vec3(0.42, 0.53, 0.68), 0.65 * lot + 0.35 * at.y);
        if (door) pane = mix(vec3(0.30, 0.20, 0.15), vec3(0.16, 0.24, 0.22), step(0.5, fract(seed * 5.0)));
        vec3 trim = mix(wall, vec3(0.93), 0.45);
        // Far away a window is smaller than a pixel; then the wall takes its mean colour.
        float blur = clamp(1.6 * max(pixel.x, pixel.y) - 0.5, 0.0, 1.0);
        frame = mix(frame, 0.42, blur);
        glass = mix(glass, 0.34, blur);
        result = mix(mix(result, trim, frame), pane, glass);
    }
    result *= 1.0 + 0.10 * step(size.y - CORNICE, place.y) - 0.16 * step(place.y, 0.45);
    return result;
}

void main() {
    float kind = floor(paint.a);
    float seed = (paint.a - kind) / 0.9;
    vec3 wall = paint.rgb;
    float bright = dot(facing, sun);
    float light = 0.73 + 0.52 * max(bright, 0.0) + 0.10 * min(bright, 0.0);
    if (kind < 0.5) {
        wall = facade(wall, seed);
        light *= 1.0 - 0.22 * exp(-1.6 * place.y);
        wall *= mix(vec3(0.95, 0.98, 1.06), vec3(1.04, 1.01, 0.96), step(0.0, bright));
    } else if (kind < 1.5) {
        float low = indoor > 0.5 ? 0.09 : 0.0;
        wall = mix(wall, wall * 0.62, step(place.y, low));
        light = mix(light, 0.90 + 0.16 * bright, indoor);
        light *= 1.0 - 0.16 * exp(-3.5 * place.y);
    } else if (kind < 2.5) {
        wall = indoor > 0.5 ? wall * 1.02 : mix(wall, vec3(0.52, 0.52, 0.53), 0.75);
        light = indoor > 0.5 ? 1.0 : 1.08;
    } else {
        wall *= indoor > 0.5 ? 0.55 : 0.85;
        light = 1.0;
    }
    colour = vec4(hazed(wall * light, world), 1.0);
}
