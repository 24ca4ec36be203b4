layout(location = 0) in vec2 corner;
uniform mat4 ray_from_corner;
uniform vec2 band;      // rows of the picture, -1…1, between which there is sky
out vec3 sky;
void main() {
    // Computed at the corners of a mesh: the sky is smooth, and pixels are many.
    vec2 place = vec2(corner.x, mix(band.x, band.y, 0.5 + 0.5 * corner.y));
    vec4 far = ray_from_corner * vec4(place, 1.0, 1.0);
    vec3 look = normalize(far.xyz / far.w - eye);
    float up = clamp(look.z, 0.0, 1.0);
    vec3 zenith = mix(ZENITH, ZENITH_INDOOR, INDOOR);
    sky = mix(HAZE, zenith, 1.0 - pow(1.0 - up, 2.6));
    float glow = max(dot(look, SUN), 0.0);
    sky += (1.0 - INDOOR) * GLOW * (0.16 * pow(glow, 10.0));
    gl_Position = vec4(place, 1.0, 1.0);
}
