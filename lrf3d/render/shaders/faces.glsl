// Bodies, lit by their normals; where these are 0, colours are as they are.
#ifdef VERTEX
layout(location = 0) in vec3 position;
layout(location = 1) in vec3 normal;
layout(location = 2) in vec3 tint;
uniform mat4 pose;
out vec3 to_eye;
out vec3 facing;
flat out vec3 paint;
void main() {
    vec4 place = pose * vec4(position, 1.0);
    to_eye = eye - place.xyz;
    facing = mat3(pose) * normal;
    paint = tint;
    gl_Position = view_projection * place;
}
#else
in vec3 to_eye;
in vec3 facing;
flat in vec3 paint;
out vec4 colour;
void main() {
#ifdef MIRRORED
    through_mirror(-to_eye);
#endif
    vec3 shaded = paint;
    if (dot(facing, facing) > 0.0) {
        vec3 up = normalize(facing);
        vec3 back = normalize(to_eye);
        float light = BODY_LIGHT.x + BODY_LIGHT.y * max(dot(up, SUN), 0.0) + BODY_LIGHT.z * up.z;
        float shine = max(dot(up, normalize(SUN + back)), 0.0);
        // Powers by squaring: 32 and 3.
        shine *= shine; shine *= shine; shine *= shine; shine *= shine; shine *= shine;
        float rim = 1.0 - max(dot(up, back), 0.0);
        shaded = paint * light + 0.22 * shine + 0.07 * rim * rim * rim;
    }
#ifdef MIRRORED
    shaded *= REFLECTED;
#endif
    colour = vec4(hazed(shaded), 1.0);
}
#endif
