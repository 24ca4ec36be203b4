// The painted ground; in the PLAN only where it was seen.
uniform vec2 clock;     // what time it is [lengths of the run], and the film's seconds in one
#ifdef VERTEX
layout(location = 0) in vec2 corner;
uniform vec4 area;      // lower left corner of the picture [m], and one over its size [1/m]
uniform vec4 grid;      // the same of the picture of times
out vec2 uv;
out vec2 foot;
#ifdef MIRRORED
out vec3 way;           // from the eye
#endif
void main() {
    uv = (corner - area.xy) * area.zw;
    foot = (corner - grid.xy) * grid.zw;
    vec3 place = vec3(corner, 0.0);
#ifdef MIRRORED
    way = place - eye;
#endif
    gl_Position = view_projection * vec4(place, 1.0);
}
#else
in vec2 uv;
in vec2 foot;
#ifdef MIRRORED
in vec3 way;
#endif
uniform sampler2D picture;
uniform sampler2D times;
out vec4 colour;
void main() {
#ifdef MIRRORED
    through_mirror(way);
#endif
    vec4 when = texture(times, foot);
    float since = age(when, clock);
    float on = lit(when, since);
#ifdef PLAN
    colour = vec4(mix(EXPLORED, EMBER, 0.55 / (1.0 + 2.0 * since * since)), on);
#else
    vec3 day = texture(picture, uv, -GROUND_SHARPNESS).rgb;
    vec3 seen = hazed(exposed(day, day, on, since, 0.0));
#ifdef MIRRORED
    seen *= REFLECTED;
#endif
    colour = vec4(seen, 1.0);
#endif
}
#endif
