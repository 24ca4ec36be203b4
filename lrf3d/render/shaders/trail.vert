layout(location = 0) in vec2 middle;
layout(location = 1) in vec2 side;
layout(location = 2) in float when;
uniform float half_width;
out float time;
out vec3 way;           // from the eye, in units of the haze
void main() {
    time = when;
    vec3 world = vec3(middle + side * half_width, 0.0);
    way = (world - eye) * thick;
    gl_Position = raised(world, 0.01);
}
