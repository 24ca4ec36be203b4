layout(location = 0) in vec2 corner;
uniform vec4 blob;      // middle x, y and radius [m], darkness
out vec2 place;
void main() {
    place = corner;
    gl_Position = raised(vec3(blob.xy + corner * blob.z, 0.0), 0.005);
}
