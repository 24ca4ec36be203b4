layout(location = 0) in vec3 position;
layout(location = 1) in vec3 normal;
layout(location = 2) in vec2 along_up;
layout(location = 3) in vec2 extent;
layout(location = 4) in vec4 colour_kind;
layout(location = 5) in float under_shade;
out vec3 way;               // from the eye, in units of the haze
out vec2 cell;              // along and up the face, in rooms
out float under;            // how far under the edge of its shade [m]
flat out vec2 room;         // width of a bay and height of a storey [m]
flat out vec3 wall;         // colour of the plaster
flat out vec3 light;        // how much of each colour the face gets
flat out vec4 style;        // half sides of windows in rooms, column of the door or -1, seed
flat out vec2 ends;         // storeys, and where the cornice begins, in rooms

const float BAY = 2.7;      // about the distance between windows [m]
const float STOREY = 3.1;   // about the height of a storey [m]
const float CORNICE = 0.45; // height of the band under the roof [m]
const float NARROW = 1.7;   // no window fits in a face as short as this [m]

void main() {
    // All that is the same on the whole face is reckoned here, and not for each pixel.
    float seed = (colour_kind.a - floor(colour_kind.a)) / 0.9;
    float bays = max(1.0, floor(extent.x / BAY));
    float storeys = max(1.0, floor((extent.y - CORNICE) / STOREY));
    room = vec2(extent.x / bays, (extent.y - CORNICE) / storeys);
    cell = along_up / room;
    under = under_shade;
    wall = colour_kind.rgb;
    float bright = dot(normal, sun);
    light = (0.73 + 0.52 * max(bright, 0.0) + 0.10 * min(bright, 0.0))
        * mix(vec3(0.95, 0.98, 1.06), vec3(1.04, 1.01, 0.96), step(0.0, bright));
    float door = bays > 1.5 ? floor(seed * 0.999 * bays) : -1.0;
    style = vec4(0.24 + 0.09 * fract(seed * 7.31), 0.25 + 0.07 * fract(seed * 3.17), door, seed);
    ends = vec2(extent.x > NARROW ? storeys : 0.0, storeys);
    way = (position - eye) * haze.a;
    gl_Position = view_projection * vec4(position, 1.0);
}
