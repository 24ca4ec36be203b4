// The painted ground.
#ifdef VERTEX
layout(location = 0) in vec2 corner;
uniform vec4 area;      // lower left corner of the picture [m], and one over its size [1/m]
out vec2 uv;
out vec3 way;           // from the eye, in units of the haze
void main() {
    uv = (corner - area.xy) * area.zw;
    vec3 place = vec3(corner, 0.0);
    way = (place - eye) * thick;
    gl_Position = view_projection * vec4(place, 1.0);
}
#else
in vec2 uv;
in vec3 way;
uniform sampler2D picture;
out vec4 colour;
void main() {
    colour = vec4(hazed(texture(picture, uv, -SHARPNESS).rgb, way), 1.0);
}
#endif
