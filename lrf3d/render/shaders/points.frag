in vec3 paint;
in float diameter;
out vec4 colour;
void main() {
    float away = length(gl_PointCoord - 0.5) * (POINT_HALO * diameter + 1.0);
    float cover = clamp(0.5 * diameter + 0.5 - away, 0.0, 1.0);
    // The middle is white-hot, and light blooms round the point.
    float hot = 0.6 * (1.0 - smoothstep(0.0, 0.4, away / diameter));
    float bloom = max(1.0 - 2.0 * away / (POINT_HALO * diameter), 0.0);
    colour = vec4(mix(paint, vec3(1.0), hot), max(cover, POINT_HALO_STRENGTH * bloom * bloom));
}
