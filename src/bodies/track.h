/* Track: prescribed motion from a file: CSV with a column t and any of x, y, z (place), u, v, w (velocity), angle,
   omega (about z, or -particle_<g>_axis in 3D), one line a time.

   Between the lines each column is a cubic spline with continuous second derivatives (de Boor 1978, chapter IV), so
   that velocities and accelerations are smooth; its motion counts from the first line, wherever a body starts.

   Before the first line and after the last one: held (default), places and angles stay, the spline ends with
   velocity zero there (at the first line only if its t is positive; else the motion begins with the velocity of the
   natural spline), velocities stay as they are; repeated (_motion_repeat), the file begins anew, one turn later:
   what a place gained in a period is added each time, velocities have to end as they began. */
#pragma once
#include <petscsys.h>

typedef struct _p_Track *Track;

/* Read -particle_<g>_motion_file; *track NULL: not given. Collective. Errors: of csv.h; no column t, unknown columns,
   place and velocity of the same axis, times that do not rise, too few lines, a repeated velocity that jumps. */
PetscErrorCode TrackRead(const char group[], PetscInt dim, Track *track);
PetscErrorCode TrackDestroy(Track *);
/* Does the file say something of axis a (0, 1, 2), or of the turn (3)? */
PetscBool TrackHas(Track, PetscInt a);
/* Way from the first line to a time, and velocity: of axis a, or angle and angular velocity (3). */
void TrackEvaluate(Track, PetscInt a, PetscReal time, PetscReal *displacement, PetscReal *velocity);
