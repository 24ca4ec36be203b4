in vec3 way;
in float height;
in float under;
flat in vec3 wall;
flat in vec3 skirting;
flat in vec4 foot;
out vec4 colour;
void main() {
    vec3 result = height <= foot.x ? skirting : wall;
    float near = foot.z * height;
    result *= 1.0 - foot.y / (1.0 + near + 0.5 * near * near);
    float shaded = clamp(under / (fwidth(under) + 0.04) + 0.5, 0.0, 1.0);
    result *= mix(1.0, foot.w, shaded);
    float far = dot(way, way);
    colour = vec4(mix(result, haze.rgb, far / (1.0 + far)), 1.0);
}
