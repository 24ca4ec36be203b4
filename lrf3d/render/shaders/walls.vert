layout(location = 0) in vec3 position;
layout(location = 1) in vec3 normal;
layout(location = 2) in vec2 along_up;
layout(location = 3) in vec2 extent;
layout(location = 4) in vec4 colour_kind;
out vec3 world;
out vec2 place;
flat out vec3 facing;
flat out vec2 size;
flat out vec4 paint;
void main() {
    world = position;
    place = along_up;
    facing = normal;
    size = extent;
    paint = colour_kind;
    gl_Position = view_projection * vec4(position, 1.0);
}
