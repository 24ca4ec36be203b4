layout(location = 0) in vec3 position;
layout(location = 2) in vec3 colour;
layout(location = 3) in vec3 bright;
layout(location = 4) in float under_shadow;
layout(location = 5) in vec3 shaded;
out vec3 way;               // from the eye, in units of the haze
out float under;            // how far under the edge of its shadow [m]
flat out vec3 wall;         // colour of the wall
out vec3 light;             // how much of each colour the face gets in the sun
out vec3 shade;             // and where the sun is hidden
void main() {
    wall = colour;
    light = bright;
    shade = shaded;
    under = under_shadow;
    way = (position - eye) * thick;
    gl_Position = view_projection * vec4(position, 1.0);
}
