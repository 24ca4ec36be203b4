// What all shaders know: the camera of the picture, and its air. In fragment shaders each uniform
// takes time for each block of pixels; what is the same in all pictures of a film is a constant.
layout(std140) uniform Camera {
    mat4 view_projection;
    vec3 eye;
    float thick;        // one over the distance [m] at which half is haze
    vec2 viewport;      // [pixels]
    float slack;        // how much the depth of marks gains with their distance
    float nearer;       // how much nearer to the eye the depth of marks is [m]
};

// A colour seen at a distance from the eye, which is in units of the haze.
vec3 hazed(vec3 colour, vec3 way) {
    // Grows with the square of the distance and needs neither a root nor an exponential.
    float far = dot(way, way);
    return mix(colour, HAZE, far / (1.0 + far));
}

// Where a point is drawn whose depth is that of a point nearer to the eye by so many metres: what
// lies on a surface then shows, and what lies behind one does not.
vec4 raised(vec3 place, float metres) {
    vec3 ray = eye - place;
    float away = length(ray);
    vec4 drawn = view_projection * vec4(place, 1.0);
    vec4 near = view_projection * vec4(place + ray / away * min(metres + slack * away, 0.5 * away), 1.0);
    drawn.z = near.z / near.w * drawn.w;
    return drawn;
}

// Whether what lies on a thin wall is seen: from the side that it faces, or from far above.
bool shown(vec3 place, vec2 side) {
    return nearer > 1e3 || dot(eye.xy - place.xy, side) >= 0.0;
}
