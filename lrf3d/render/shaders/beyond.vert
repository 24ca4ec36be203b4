layout(location = 0) in vec2 corner;
uniform vec4 area;      // lower left corner of the picture [m], and one over its size [1/m]
uniform float below;    // height [m]: under finer pieces
out vec2 uv;
out vec3 way;           // from the eye [m]
void main() {
    uv = (corner - area.xy) * area.zw;
    vec3 place = vec3(corner, below);
    way = place - eye;
    gl_Position = view_projection * vec4(place, 1.0);
}
