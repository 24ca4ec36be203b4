layout(location = 0) in vec3 position;
layout(location = 1) in vec3 normal;
layout(location = 2) in vec3 tint;
uniform mat4 world_from_robot;
out vec3 to_eye;
out vec3 facing;
flat out vec3 paint;
void main() {
    vec4 place = world_from_robot * vec4(position, 1.0);
    to_eye = eye - place.xyz;
    facing = mat3(world_from_robot) * normal;
    paint = tint;
    gl_Position = view_projection * place;
}
