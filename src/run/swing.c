/* Swing: see swing.h. */
#include "compat.h"
#include "swing.h"
#include "base/opt.h"
#include "bodies/local.h"
#include "promise.h"
#include "stream.h"

#define INERTIA 10  /* sqrt(8) pi U^2/(A D), below which inertia is most of the force */
#define TIMES   256 /* in a run */
#define FEW     8   /* bodies of a group that are looked at */

static PetscErrorCode find_end(PetscReal *end)
{
  PetscReal dt = 0.01, steps = 100;
  PetscBool given;

  PetscFunctionBeginUser;
  PetscCall(OptPeekReal("-sim_dt", &dt, &given));
  PetscCall(OptPeekReal("-sim_steps", &steps, &given));
  *end = dt * steps;
  PetscCall(OptPeekReal("-sim_time", end, &given));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Does what is prescribed of the translation of body k swing, and how fast: A/U, 0: not */
static PetscErrorCode find_rate(Bodies bodies, const BodyState *s, PetscInt k, PetscReal end, PetscReal *rate)
{
  const PetscReal dt = end / TIMES;
  PetscReal       before[3], u[3], w[3], speed = 0, acceleration = 0;

  PetscFunctionBeginUser;
  PetscCall(BodiesGetPrescribedVelocity(bodies, k, 0, before, w));
  for (PetscInt i = 1; i <= TIMES; i++) {
    PetscCall(BodiesGetPrescribedVelocity(bodies, k, i * dt, u, w));
    for (PetscInt a = 0; a < s->dim; a++) {
      if (BodiesIsFree(bodies, k, a)) continue;
      speed += PetscSqr(0.5 * (u[a] + before[a]));
      acceleration += PetscSqr((u[a] - before[a]) / dt);
      before[a] = u[a];
    }
  }
  speed        = PetscSqrtReal(speed / TIMES);
  acceleration = PetscSqrtReal(acceleration / TIMES);
  *rate        = 0;
  if (speed > 0 && 2 * PETSC_SQRT2 * PETSC_PI * PetscSqr(speed) < INERTIA * 2 * BodiesGetRadius(s, k) * acceleration)
    *rate = acceleration / speed;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode SwingFind(const MeshLocal *l, Bodies bodies, Swing *swing)
{
  BodyState *s;
  PetscReal  end, thick, layer, density, viscosity;

  PetscFunctionBeginUser;
  *swing = SWING_NONE;
  PetscCall(BodiesGetState(bodies, &s));
  PetscCall(StreamPeekFluid(&density, &viscosity));
  PetscCall(find_end(&end));
  for (PetscInt g = 0; g < s->ngroups && end > 0; g++) {
    PetscReal fastest = 0, rate = 0;
    PetscInt  seen = 0;

    if (!s->group[g].motion.given || s->group[g].body_fitted) continue;
    for (PetscInt k = 0; k < s->n && seen < FEW; k++) {
      if (s->body_group[k] != g) continue;
      PetscCall(find_rate(bodies, s, k, end, &rate));
      fastest = PetscMax(fastest, rate);
      seen++;
    }
    PetscCall(BodiesMax(bodies, 1, &fastest));
    if (fastest == 0) continue;
    PetscCall(PromiseMeasureThickness(l, bodies, g, &thick));
    layer = PetscSqrtReal(2 * viscosity / (density * fastest)) / l->h;
    if (layer < swing->layer) {
      swing->layer       = layer;
      swing->layer_group = g;
    }
    if (thick <= 0 || thick >= swing->cells) continue;
    swing->cells = thick;
    swing->group = g;
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}
