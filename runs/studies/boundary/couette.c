/* Disc of radius 1 that turns at unit speed in Couette flow (outer radius 2, exact velocity on the box), at rest or
   carried along by a uniform stream U: by Galilei an exact unsteady solution for every density of the disc. A line for
   each step: time, force and torque in residual form, torque in volume form, error of the velocity in the L2 norm,
   rigid velocity. Takes all options of the program, and -study_stream U,V -study_steps n -study_dt dt -study_held (the
   disc is free and the exact torque of the fluid is balanced). */
#include "compat.h"
#include "bodies/write.h"
#include "couple/couple.h"
#include "base/opt.h"

static const OptSpec SPECS[] = {
  {"-study_stream", OPT_REALS, "", OPT_ANY, "0,0", .help = "uniform stream"},
  {"-study_steps", OPT_INT, "", 1, 100000, "6", .help = "steps"},
  {"-study_dt", OPT_REAL, "", OPT_ABOVE_ZERO, "1e4", .help = "time step"},
  {"-study_held", OPT_BOOL, "", OPT_ANY, "false", .help = "balance the torque of a free disc"},
};
OPT_TABLE("study", SPECS)

typedef struct {
  PetscReal X[2], U[2], time, inner; /* inner: radius up to which the disc's rotation is taken */
} Exact;

/* Velocity at x; where the inside of the disc is no part of the fluid (snap) that of the fluid is continued a bit */
static void evaluate(const Exact *e, PetscReal t, const PetscReal x[], PetscReal u[])
{
  const PetscReal r[2] = {x[0] - e->X[0] - e->U[0] * t, x[1] - e->X[1] - e->U[1] * t}, r2 = r[0] * r[0] + r[1] * r[1];
  const PetscReal turn = r2 < e->inner * e->inner ? 1 : -1 / 3.0 + 4 / (3 * r2);

  u[0] = e->U[0] - turn * r[1];
  u[1] = e->U[1] + turn * r[0];
}

static PetscErrorCode set_walls(Flow flow, const Exact *e, const MeshLocal *l)
{
  const PetscInt  *fixed;
  const PetscReal *value;

  PetscFunctionBeginUser;
  PetscCall(ConditionsGetValues(FlowConditions(flow), &fixed, &value));
  for (PetscInt i = 0; i < l->nnode_all; i++)
    if (fixed[i]) evaluate(e, e->time, l->x + 2 * i, (PetscReal *)value + 2 * i);
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode find_error(Flow flow, Couple couple, const Exact *e, const MeshLocal *l, PetscReal *error)
{
  const PetscReal *u, *p, *m;
  const PetscInt  *body;

  PetscFunctionBeginUser;
  PetscCall(CoupleGetSolution(couple, &u, &p));
  PetscCall(CoupleGetNodeBody(couple, &body));
  PetscCall(FlowGetLumpedMass(flow, &m));
  *error = 0;
  for (PetscInt i = 0; i < l->nnode; i++) {
    const PetscReal r[2] = {l->x[2 * i] - e->X[0] - e->U[0] * e->time, l->x[2 * i + 1] - e->X[1] - e->U[1] * e->time};
    PetscReal       v[2];

    if (body[i] >= 0 || r[0] * r[0] + r[1] * r[1] < 1) continue;
    evaluate(e, e->time, l->x + 2 * i, v);
    for (PetscInt a = 0; a < 2; a++) *error += PetscAbsReal(m[i]) * PetscSqr(u[2 * i + a] - v[a]);
  }
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, error, 1, MPIU_REAL, MPIU_SUM, PETSC_COMM_WORLD));
  *error = PetscSqrtReal(*error);
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode run(void)
{
  Mesh                  mesh;
  Flow                  flow;
  Bodies                bodies;
  Couple                couple;
  BodyArrays           *s;
  const MeshLocal      *l;
  const FlowParameters *par;
  Exact                 e        = {{0, 0}, {0, 0}, 0, 1};
  char                  method[16] = "";
  PetscBool             snap;
  PetscInt              steps = 6;
  PetscReal             dt    = 1e4, *u;
  PetscBool             held  = PETSC_FALSE;

  PetscFunctionBeginUser;
  PetscCall(OptRealArray("-study_stream", 2, e.U, NULL));
  PetscCall(OptInt("-study_steps", &steps));
  PetscCall(OptReal("-study_dt", &dt));
  PetscCall(OptBool("-study_held", &held));
  PetscCall(PetscOptionsGetString(NULL, NULL, "-couple_method", method, sizeof(method), NULL));
  PetscCall(PetscStrcmp(method, "aligned", &snap));
  if (snap) e.inner = 0.7;
  PetscCall(MeshCreate(PETSC_COMM_WORLD, &mesh));
  PetscCall(MeshGetLocal(mesh, &l));
  PetscCall(FlowCreate(mesh, &flow));
  PetscCall(BodiesCreate(2, l->lower, l->upper, &bodies));
  PetscCall(BodiesGetArrays(bodies, &s));
  PetscCall(CoupleCreate(flow, bodies, &couple));
  PetscCall(FlowGetParameters(flow, &par));
  for (PetscInt a = 0; a < 2; a++) e.X[a] = s->x[0][a];
  PetscCall(FlowBeginStep(flow, dt, dt));
  PetscCall(CoupleUpdateGeometry(couple)); /* the mesh of the first step, on which the field before it is given */
  PetscCall(FlowGetFields(flow, &u, NULL, NULL));
  for (PetscInt i = 0; i < l->nnode_all; i++) evaluate(&e, 0, l->x + 2 * i, u + 2 * i);
  PetscCall(PetscPrintf(PETSC_COMM_WORLD, "time,fx,fy,torque,fx_volume,fy_volume,torque_volume,error,u,v,w,iterations\n"));
  for (PetscInt step = 0; step < steps; step++) {
    PetscReal          residual[6], volume[6], error;
    PetscInt           its;
    KSPConvergedReason reason;

    e.time += dt;
    if (held) s->contact_torque[0][2] = 16 * PETSC_PI * par->viscosity / 3;
    PetscCall(FlowBeginStep(flow, e.time, dt));
    PetscCall(set_walls(flow, &e, l));
    PetscCall(CoupleUpdateGeometry(couple));
    PetscCall(CoupleSolve(couple, &its, &reason));
    PetscCheck(reason > 0, PETSC_COMM_WORLD, PETSC_ERR_NOT_CONVERGED, "Step %" PetscInt_FMT " failed: %s", step, KSPConvergedReasons[reason]);
    PetscCall(CoupleForce(couple));
    PetscCall(CoupleForceForms(couple, 0, residual, volume));
    PetscCall(find_error(flow, couple, &e, l, &error));
    PetscCall(CoupleAdvance(couple));
    PetscCall(PetscPrintf(PETSC_COMM_WORLD, "%.8g,%.12g,%.12g,%.12g,%.12g,%.12g,%.12g,%.6e,%.12g,%.12g,%.12g,%" PetscInt_FMT "\n", (double)e.time,
                          (double)residual[0], (double)residual[1], (double)residual[5], (double)volume[0], (double)volume[1], (double)volume[5],
                          (double)error, (double)s->u[0][0], (double)s->u[0][1], (double)s->w[0][2], its));
  }
  PetscCall(CoupleDestroy(&couple));
  PetscCall(BodiesDestroy(&bodies));
  PetscCall(FlowDestroy(&flow));
  PetscCall(MeshDestroy(&mesh));
  PetscFunctionReturn(PETSC_SUCCESS);
}

int main(int argc, char **argv)
{
  PetscCall(PetscInitialize(&argc, &argv, NULL, NULL));
  PetscCall(run());
  PetscCall(OptFinalize());
  PetscCall(ShapeFinalize());
  PetscCall(PetscFinalize());
  return 0;
}
