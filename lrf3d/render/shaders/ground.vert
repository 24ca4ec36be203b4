layout(location = 0) in vec3 corner;    // x, y [m], and 1 if it is where the near part begins
uniform vec4 area;      // lower left corner of the picture [m], and one over its size [1/m]
uniform vec4 near;      // least and largest x and y of the near part [m]
uniform float below;    // height [m]: under finer pieces
out vec2 uv;
out vec3 way;           // from the eye [m]
void main() {
    vec2 at = corner.z > 0.5 ? clamp(corner.xy, near.xy, near.zw) : corner.xy;
    uv = (at - area.xy) * area.zw;
    vec3 place = vec3(at, below);
    way = place - eye;
    gl_Position = view_projection * vec4(place, 1.0);
}
