// Round points; light blooms round those that GLOW.
#ifdef VERTEX
layout(location = 0) in vec3 position;
layout(location = 1) in vec4 tint;
layout(location = 2) in vec2 side;      // where the wall's face looks, or 0
uniform vec3 sizes;         // diameter [pixels at 1 m], smallest and largest [pixels]
out vec4 paint;
out float diameter;
void main() {
    paint = tint;
    gl_Position = raised(position, nearer);
    if (!shown(position, side)) gl_Position.z = 2.0 * gl_Position.w;
    diameter = clamp(sizes.x / gl_Position.w, sizes.y, sizes.z);
#ifdef GLOW_ROUND
    gl_PointSize = POINT_HALO * diameter + 1.0;
#else
    gl_PointSize = diameter + 1.0;
#endif
}
#else
in vec4 paint;
in float diameter;
out vec4 colour;
void main() {
#ifdef GLOW_ROUND
    float away = length(gl_PointCoord - 0.5) * (POINT_HALO * diameter + 1.0);
    float cover = clamp(0.5 * diameter + 0.5 - away, 0.0, 1.0);
    // The middle is white-hot, and light blooms round the point.
    float hot = 0.6 * (1.0 - smoothstep(0.0, 0.4, away / diameter));
    float bloom = max(1.0 - 2.0 * away / (POINT_HALO * diameter), 0.0);
    float alpha = max(cover, POINT_HALO_STRENGTH * bloom * bloom);
    colour = vec4(mix(paint.rgb, vec3(1.0), hot), paint.a * alpha);
#else
    float away = length(gl_PointCoord - 0.5) * (diameter + 1.0);
    colour = vec4(paint.rgb, paint.a * clamp(0.5 * diameter + 0.5 - away, 0.0, 1.0));
#endif
}
#endif
