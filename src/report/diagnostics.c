/* Probe: see diagnostics.h. */
#include "compat.h"
#include "report/diagnostics.h"
#include "fem/element.h"
#include "history.h"
#include "scalarcolumns.h"
#include "base/opt.h"

#define NEAR_CELL 1e-3 /* beyond the cell in its reference coordinates */

enum {
  CD,
  CL,
  CD_RESIDUAL,
  CL_RESIDUAL,
  CD_VOLUME,
  CL_VOLUME,
  NCOEFFICIENTS
};
static const char *const COEFFICIENTS[NCOEFFICIENTS] = {"cd",          "cl",        "cd_residual",
                                                        "cl_residual", "cd_volume", "cl_volume"};
static const char *const TERMS[]                     = {"fluid", "bodies", "walls", "inout", "body_force", "others"};
static const char *const ELASTIC[] = {"elastic_energy", "conformation_trace_max", "conformation_eigenvalue_min"};
static const char *const DEFORM[]  = {"deform_area_min", "deform_area_max", "deform_jacobian"};

typedef struct {
  PetscInt  body, column; /* permanent number; first of its columns */
  PetscReal speed, length, scale;
  PetscReal difference, largest; /* of the two forms of the force, over the run */
  char      suffix[72];          /* of the names: "" or _<group> */
} Coefficient;

typedef struct {
  PetscReal x[3];
  PetscInt  n, *cell; /* own cells whose bounding box comes near */
} Point;

struct _p_Diagnostics {
  MPI_Comm              comm;
  Flow                  flow;
  Mesh                  mesh;
  Couple                couple;
  Monitor               monitor;
  BodyState            *s;
  const MeshLocal      *loc;
  PetscInt              ncoefficient;
  Coefficient          *coefficient;
  PetscBool             dp, momentum;
  PetscInt              nterms; /* of the balance of momentum that have columns */
  Point                 point[2];
  PetscReal             from;
  PetscInt              dp_column, momentum_column, driving_column, count_column, deform_column, ncolumn, ncount;
  const CoupleCount    *count;                       /* [ncount] of the boundary method */
  PetscReal             counted[8];                  /* [ncount] their sums over the steps of this run */
  const DeformResult   *deform;                      /* NULL: the mesh does not follow bodies */
  const FlowRateResult *flow_rate;                   /* or NULL */
  PetscInt              flow_rate_column;            /* force, then, with a back-flow condition, its error */
  PetscInt              frame_column;                /* of a box that travels */
  PetscInt              elastic_column, swim_column; /* swim: -1: no body has slip */
  const FlowElasticity *elastic;                     /* or NULL */
  PetscInt              flow_column, nboundary;      /* mean velocity, then each boundary's flow rate or force */
  const CoupleBoundary *boundary;
  PetscInt              scalar_column, nscalar; /* those of scalars: first, how many */
  PetscReal            *value;                  /* [ncolumn] of this step */
  History               history;
};

/* ---- set-up ---- */

static PetscErrorCode add_column(Diagnostics b, const char name[], PetscInt *first)
{
  PetscInt column;

  PetscFunctionBeginUser;
  PetscCall(MonitorAddColumn(b->monitor, name, &column));
  if (first) *first = b->ncolumn;
  b->ncolumn++;
  PetscCheck(column == b->ncolumn - 1, PETSC_COMM_SELF, PETSC_ERR_PLIB, "Another module has added columns before");
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode read_coefficient(Diagnostics b, const BodyGroup *g)
{
  const FlowParameters *par;
  Coefficient          *c = b->coefficient + b->ncoefficient;
  char                  speed[128], length[128];
  PetscBool             given;

  PetscFunctionBeginUser;
  PetscCall(PetscSNPrintf(speed, sizeof(speed), "-particle_%s_reference_speed", g->name));
  PetscCall(PetscSNPrintf(length, sizeof(length), "-particle_%s_reference_length", g->name));
  PetscCall(OptHas(speed, &given));
  if (!given) PetscFunctionReturn(PETSC_SUCCESS);
  c->length = 2 * g->largest * g->radius;
  PetscCall(OptReal(speed, &c->speed));
  PetscCall(OptReal(length, &c->length));
  PetscCheck(g->count == 1, b->comm, PETSC_ERR_USER_INPUT,
             "Option %s: group '%s' has %" PetscInt_FMT
             " bodies, coefficients are those of one: give it a group of its own",
             speed, g->name, g->count);
  PetscCall(FlowGetParameters(b->flow, &par));
  c->body  = g->first;
  c->scale = 2 / (par->density * c->speed * c->speed * (b->loc->dim == 3 ? c->length * c->length : c->length));
  PetscCall(PetscStrncpy(c->suffix, g->name, sizeof(c->suffix)));
  b->ncoefficient++;
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode name_coefficients(Diagnostics b)
{
  PetscFunctionBeginUser;
  for (PetscInt i = 0; i < b->ncoefficient; i++) {
    Coefficient *c = b->coefficient + i;
    char         group[72], name[128];

    PetscCall(PetscStrncpy(group, c->suffix, sizeof(group)));
    PetscCall(PetscSNPrintf(c->suffix, sizeof(c->suffix), b->ncoefficient > 1 ? "_%s" : "", group));
    for (PetscInt k = 0; k < NCOEFFICIENTS; k++) {
      PetscCall(PetscSNPrintf(name, sizeof(name), "%s%s", COEFFICIENTS[k], c->suffix));
      PetscCall(add_column(b, name, k ? NULL : &c->column));
    }
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Own cells that may hold the point, also when their nodes move by half of their size; where the mesh follows bodies,
   those of this step */
static PetscErrorCode find_candidates(Diagnostics b, Point *p)
{
  const MeshLocal *l = b->loc;

  PetscFunctionBeginUser;
  p->n = 0;
  PetscCall(PetscFree(p->cell));
  PetscCall(PetscMalloc1(l->ncell, &p->cell));
  for (PetscInt c = 0; c < l->ncell; c++) {
    PetscReal xc[MESH_MAX_NB * 3];
    PetscBool near = PETSC_TRUE;

    PetscCall(MeshCellCoordinates(b->mesh, c, xc));
    for (PetscInt d = 0; d < l->dim; d++) {
      PetscReal lo = PETSC_MAX_REAL, hi = -PETSC_MAX_REAL;

      for (PetscInt j = 0; j < l->nb; j++) {
        lo = PetscMin(lo, xc[j * l->dim + d]);
        hi = PetscMax(hi, xc[j * l->dim + d]);
      }
      if (p->x[d] < lo - 0.5 * (hi - lo) || p->x[d] > hi + 0.5 * (hi - lo)) near = PETSC_FALSE;
    }
    if (near) p->cell[p->n++] = c;
  }
  PetscCall(PetscRealloc(PetscMax(1, p->n) * sizeof(PetscInt), &p->cell));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Mean of the pressure over the cells that hold the point, those with their centre outside of bodies first; *n their
   number on all ranks */
static PetscErrorCode read_pressure(Diagnostics b, const Point *point, const PetscReal p[], PetscReal *value,
                                    PetscInt *n)
{
  const MeshLocal *l = b->loc;
  const PetscInt  *body;
  PetscReal        sum[4] = {0, 0, 0, 0}; /* values and number outside bodies, inside */

  PetscFunctionBeginUser;
  PetscCall(CoupleGetNodeBody(b->couple, &body));
  for (PetscInt i = 0; i < point->n; i++) {
    const PetscInt c = point->cell[i];
    PetscReal      xc[MESH_MAX_NB * 3], xi[3], at;
    PetscBool      is_fixed;

    PetscCall(MeshCellCoordinates(b->mesh, c, xc));
    is_fixed = ElementLocate(l->dim, xc, point->x, xi);
    for (PetscInt d = 0; d < l->dim && is_fixed; d++) is_fixed = (PetscBool)(PetscAbsReal(xi[d]) <= 1 + 2 * NEAR_CELL);
    if (!is_fixed) continue;
    PetscCall(FlowCellPressure(b->flow, c, p, point->x, &at));
    {
      const PetscInt inside = body[l->cell_node[c * l->nb + l->nb / 2]] >= 0 ? 2 : 0;

      sum[inside] += at;
      sum[inside + 1]++;
    }
  }
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, sum, 4, MPIU_REAL, MPIU_SUM, b->comm));
  *n     = (PetscInt)(sum[1] + sum[3]);
  *value = sum[1] > 0 ? sum[0] / sum[1] : sum[2] / sum[3];
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode read_points(Diagnostics b)
{
  const PetscInt dim  = b->loc->dim;
  PetscReal      x[6] = {0}, *zero, unused;
  PetscInt       n;

  PetscFunctionBeginUser;
  PetscCall(OptRealArray("-monitor_dp", 2 * dim, x, &b->dp));
  if (!b->dp) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(PetscCalloc1(b->loc->ncell * (dim + 1), &zero));
  for (PetscInt i = 0; i < 2; i++) {
    for (PetscInt d = 0; d < dim; d++) b->point[i].x[d] = x[i * dim + d];
    PetscCall(find_candidates(b, b->point + i));
    PetscCall(read_pressure(b, b->point + i, zero, &unused, &n));
    PetscCheck(n > 0, b->comm, PETSC_ERR_USER_INPUT,
               "Option -monitor_dp: point (%g, %g, %g) lies in no cell of the mesh, move it inside",
               (double)b->point[i].x[0], (double)b->point[i].x[1], (double)b->point[i].x[2]);
  }
  PetscCall(PetscFree(zero));
  PetscCall(add_column(b, "dp", &b->dp_column));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode read_momentum(Diagnostics b)
{
  PetscFunctionBeginUser;
  PetscCall(OptBool("-monitor_momentum", &b->momentum));
  b->nterms = CoupleHasOthers(b->couple) ? 6 : 5;
  for (PetscInt i = 0; b->momentum && i < b->nterms * b->loc->dim; i++) {
    char name[64];

    PetscCall(
      PetscSNPrintf(name, sizeof(name), "momentum_%s_%c", TERMS[i / b->loc->dim], (char)('x' + i % b->loc->dim)));
    PetscCall(add_column(b, name, i ? NULL : &b->momentum_column));
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode add_mesh_columns(Diagnostics b)
{
  PetscFunctionBeginUser;
  PetscCall(CoupleGetCounts(b->couple, &b->ncount, &b->count));
  PetscCheck(b->ncount <= (PetscInt)PETSC_STATIC_ARRAY_LENGTH(b->counted), PETSC_COMM_SELF, PETSC_ERR_PLIB,
             "More counts of a method than there is room for");
  for (PetscInt i = 0; i < b->ncount; i++) PetscCall(add_column(b, b->count[i].name, i ? NULL : &b->count_column));
  PetscCall(CoupleGetDeform(b->couple, &b->deform));
  for (PetscInt i = 0; i < 3 && b->deform; i++) PetscCall(add_column(b, DEFORM[i], i ? NULL : &b->deform_column));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Mean velocity, flow rates of openings, forces on walls */
static PetscErrorCode add_flow_columns(Diagnostics b)
{
  char name[128];

  PetscFunctionBeginUser;
  for (PetscInt a = 0; a < b->loc->dim; a++) {
    PetscCall(PetscSNPrintf(name, sizeof(name), "mean_velocity_%c", (char)('x' + a)));
    PetscCall(add_column(b, name, a ? NULL : &b->flow_column));
  }
  PetscCall(CoupleGetBoundaries(b->couple, &b->nboundary, &b->boundary));
  for (PetscInt i = 0; i < b->nboundary; i++) {
    const CoupleBoundary *d = b->boundary + i;

    PetscCall(PetscSNPrintf(name, sizeof(name), "flow_rate_%s", d->name));
    if (d->open) PetscCall(add_column(b, name, NULL));
    for (PetscInt a = 0; d->wall && a < b->loc->dim; a++) {
      PetscCall(PetscSNPrintf(name, sizeof(name), "wall_force_%s_%c", d->name, (char)('x' + a)));
      PetscCall(add_column(b, name, NULL));
    }
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* The force that the scene asks for, and the error of its back-flow */
static PetscErrorCode add_flow_rate_columns(Diagnostics b)
{
  char name[128];

  PetscFunctionBeginUser;
  b->driving_column = -1;
  if (CoupleIsDriven(b->couple)) PetscCall(add_column(b, "driving_error", &b->driving_column));
  PetscCall(CoupleGetFlowRate(b->couple, &b->flow_rate));
  if (!b->flow_rate) PetscFunctionReturn(PETSC_SUCCESS);
  for (PetscInt a = 0; a < b->loc->dim; a++) {
    PetscCall(PetscSNPrintf(name, sizeof(name), "flow_force_%c", (char)('x' + a)));
    PetscCall(add_column(b, name, a ? NULL : &b->flow_rate_column));
  }
  if (b->flow_rate->backflow) PetscCall(add_column(b, "backflow_error", NULL));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Place and velocity of a box that travels */
static PetscErrorCode add_elastic_columns(Diagnostics b)
{
  PetscFunctionBeginUser;
  PetscCall(FlowGetElasticity(b->flow, &b->elastic));
  for (PetscInt i = 0; b->elastic && i < 3; i++) PetscCall(add_column(b, ELASTIC[i], i ? NULL : &b->elastic_column));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode add_frame_columns(Diagnostics b)
{
  char name[128];

  PetscFunctionBeginUser;
  for (PetscInt i = 0; b->s->travels && i < 2 * b->loc->dim; i++) {
    PetscCall(PetscSNPrintf(name, sizeof(name), "frame_%s%c", i < b->loc->dim ? "" : "velocity_",
                            (char)('x' + i % b->loc->dim)));
    PetscCall(add_column(b, name, i ? NULL : &b->frame_column));
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode add_swim_columns(Diagnostics b)
{
  PetscFunctionBeginUser;
  b->swim_column = -1;
  if (!CoupleHasSlip(b->couple)) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(add_column(b, "swimming_speed", &b->swim_column));
  PetscCall(add_column(b, "slip_power", NULL));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode add_scalar_column(void *diagnostics, const char name[])
{
  PetscFunctionBeginUser;
  PetscCall(add_column((Diagnostics)diagnostics, name, NULL));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode DiagnosticsCreate(Flow flow, Bodies bodies, Couple couple, Monitor monitor, Diagnostics *diagnostics)
{
  Diagnostics b;

  PetscFunctionBeginUser;
  PetscCall(PetscNew(&b));
  b->comm    = MonitorComm(monitor);
  b->flow    = flow;
  b->couple  = couple;
  b->monitor = monitor;
  PetscCall(BodiesGetState(bodies, &b->s));
  PetscCall(FlowGetMesh(flow, &b->mesh));
  PetscCall(MeshGetLocal(b->mesh, &b->loc));
  PetscCall(PetscCalloc1(b->s->ngroups, &b->coefficient));
  for (PetscInt g = 0; g < b->s->ngroups; g++) PetscCall(read_coefficient(b, b->s->group + g));
  PetscCall(name_coefficients(b));
  PetscCall(read_points(b));
  PetscCall(read_momentum(b));
  PetscCall(add_mesh_columns(b));
  PetscCall(add_flow_columns(b));
  PetscCall(add_flow_rate_columns(b));
  PetscCall(add_frame_columns(b));
  PetscCall(add_elastic_columns(b));
  PetscCall(add_swim_columns(b));
  b->scalar_column = b->ncolumn;
  PetscCall(ScalarColumnsAdd(couple, b->mesh, add_scalar_column, b));
  b->nscalar = b->ncolumn - b->scalar_column;
  PetscCall(OptReal("-monitor_from", &b->from));
  PetscCall(PetscCalloc1(b->ncolumn, &b->value));
  PetscCall(HistoryCreate(b->ncolumn, &b->history));
  *diagnostics = b;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode DiagnosticsDestroy(Diagnostics *diagnostics)
{
  Diagnostics b = *diagnostics;

  PetscFunctionBeginUser;
  if (!b) PetscFunctionReturn(PETSC_SUCCESS);
  for (PetscInt i = 0; i < 2; i++) PetscCall(PetscFree(b->point[i].cell));
  PetscCall(HistoryDestroy(&b->history));
  PetscCall(PetscFree(b->value));
  PetscCall(PetscFree(b->coefficient));
  PetscCall(PetscFree(*diagnostics));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- steps ---- */

static PetscErrorCode measure_coefficient(Diagnostics b, Coefficient *c)
{
  PetscReal force[3], residual[6], volume[6], size = 0, difference = 0, *v = b->value + c->column;

  PetscFunctionBeginUser;
  PetscCall(CoupleForceForms(b->couple, c->body, force, residual, volume));
  for (PetscInt d = 0; d < 2; d++) {
    v[CD + d]          = c->scale * force[d];
    v[CD_RESIDUAL + d] = c->scale * residual[d];
    v[CD_VOLUME + d]   = c->scale * volume[d];
  }
  for (PetscInt d = 0; d < 3; d++) {
    size += residual[d] * residual[d];
    difference += (volume[d] - residual[d]) * (volume[d] - residual[d]);
  }
  c->largest    = PetscMax(c->largest, PetscSqrtReal(size));
  c->difference = PetscMax(c->difference, PetscSqrtReal(difference));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode measure_dp(Diagnostics b)
{
  const PetscReal *u, *p;
  PetscReal        at[2];
  PetscInt         n;

  PetscFunctionBeginUser;
  PetscCall(CoupleGetSolution(b->couple, &u, &p));
  for (PetscInt i = 0; i < 2; i++) {
    if (b->deform || b->loc->meshes) PetscCall(find_candidates(b, b->point + i));
    PetscCall(read_pressure(b, b->point + i, p, at + i, &n));
  }
  b->value[b->dp_column] = at[0] - at[1];
  PetscFunctionReturn(PETSC_SUCCESS);
}

static void measure_flow(Diagnostics b, const CoupleBalance *balance)
{
  PetscReal *v = b->value + b->flow_column;

  for (PetscInt a = 0; a < b->loc->dim; a++) *v++ = balance->mean[a];
  for (PetscInt i = 0; i < b->nboundary; i++) {
    const CoupleBoundary *d = b->boundary + i;

    if (d->open) *v++ = d->rate;
    for (PetscInt a = 0; d->wall && a < b->loc->dim; a++) *v++ = d->force[a];
  }
}

PetscErrorCode DiagnosticsStep(Diagnostics b, const CoupleBalance *balance)
{
  const FlowStep *step;

  PetscFunctionBeginUser;
  PetscCall(FlowGetStep(b->flow, &step));
  if (b->loc->meshes) PetscCall(CoupleGetBoundaries(b->couple, &b->nboundary, &b->boundary)); /* made anew */
  for (PetscInt i = 0; i < b->ncoefficient; i++) PetscCall(measure_coefficient(b, b->coefficient + i));
  if (b->dp) PetscCall(measure_dp(b));
  if (b->momentum) {
    const PetscReal *term[] = {balance->fluid,    balance->bodies, balance->walls,
                               balance->openings, balance->volume, balance->others};

    for (PetscInt i = 0; i < b->nterms * b->loc->dim; i++)
      b->value[b->momentum_column + i] = term[i / b->loc->dim][i % b->loc->dim];
  }
  for (PetscInt i = 0; i < b->ncount; i++) {
    b->value[b->count_column + i] = (PetscReal)b->count[i].value;
    b->counted[i] += (PetscReal)b->count[i].value;
  }
  for (PetscInt i = 0; b->deform && i < 3; i++)
    b->value[b->deform_column + i] = i < 2 ? b->deform->area[i] : b->deform->jacobian;
  if (balance) measure_flow(b, balance);
  if (balance && b->driving_column >= 0) b->value[b->driving_column] = balance->driving;
  for (PetscInt a = 0; b->s->travels && a < b->loc->dim; a++) {
    b->value[b->frame_column + a]               = b->s->frame_next[a];
    b->value[b->frame_column + b->loc->dim + a] = b->s->frame_u[a];
  }
  for (PetscInt a = 0; b->flow_rate && a < b->loc->dim; a++) b->value[b->flow_rate_column + a] = b->flow_rate->force[a];
  if (b->flow_rate && b->flow_rate->backflow) b->value[b->flow_rate_column + b->loc->dim] = b->flow_rate->error;
  if (b->elastic) {
    b->value[b->elastic_column]     = b->elastic->energy;
    b->value[b->elastic_column + 1] = b->elastic->trace;
    b->value[b->elastic_column + 2] = b->elastic->c_min;
  }
  if (b->swim_column >= 0)
    PetscCall(CoupleGetSwimming(b->couple, b->value + b->swim_column, b->value + b->swim_column + 1));
  if (b->nscalar) PetscCall(ScalarColumnsGet(b->couple, b->mesh, b->value + b->scalar_column));
  for (PetscInt i = 0; i < b->ncolumn; i++) PetscCall(MonitorSetColumn(b->monitor, i, b->value[i]));
  if (b->ncolumn) PetscCall(HistoryAdd(b->history, step->time - (1 - step->theta) * step->dt, b->value));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- end ---- */

static PetscErrorCode add_quantity(Diagnostics b, const char name[], const char suffix[], PetscReal value)
{
  char full[128];

  PetscFunctionBeginUser;
  PetscCall(PetscSNPrintf(full, sizeof(full), "%s%s", name, suffix));
  PetscCall(MonitorQuantity(b->monitor, full, value));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* dp half a period after the largest cl; if the run ends before, after the largest cl half a period before its end */
static PetscErrorCode add_half_period(Diagnostics b, const Coefficient *c, PetscReal period)
{
  PetscReal time, cl, dp, end;
  PetscBool found;

  PetscFunctionBeginUser;
  PetscCall(HistoryGetEnd(b->history, &end));
  PetscCall(HistoryGetExtremum(b->history, c->column + CL, 1, b->from, end - 0.5 * period, &time, &cl, &found));
  if (found) PetscCall(HistoryGetValue(b->history, b->dp_column, time + 0.5 * period, &dp, &found));
  if (found) PetscCall(add_quantity(b, "dp_half_period", c->suffix, dp));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode add_coefficient(Diagnostics b, const Coefficient *c)
{
  PetscReal time, value, period;
  PetscInt  n;
  PetscBool found;

  PetscFunctionBeginUser;
  for (PetscInt d = 0; d < 2; d++) {
    PetscCall(add_quantity(b, COEFFICIENTS[d], c->suffix, b->value[c->column + d]));
    PetscCall(HistoryGetExtremum(b->history, c->column + d, 1, b->from, PETSC_MAX_REAL, &time, &value, &found));
    if (!found) continue;
    PetscCall(add_quantity(b, d ? "cl_max" : "cd_max", c->suffix, value));
    PetscCall(add_quantity(b, d ? "cl_max_time" : "cd_max_time", c->suffix, time));
  }
  PetscCall(HistoryGetExtremum(b->history, c->column + CL, -1, b->from, PETSC_MAX_REAL, &time, &value, &found));
  if (found) PetscCall(add_quantity(b, "cl_min", c->suffix, value));
  PetscCall(add_quantity(b, "force_difference", c->suffix, c->largest > 0 ? c->difference / c->largest : 0));
  PetscCall(HistoryGetPeriod(b->history, c->column + CL, b->from, &period, &n));
  if (!n) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(add_quantity(b, "strouhal", c->suffix, c->length / (c->speed * period)));
  if (b->dp) PetscCall(add_half_period(b, c, period));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* What the boundary method could not do as it should, over all steps of this run: bodies that were held, and so on */
static PetscErrorCode add_counts(Diagnostics b)
{
  PetscFunctionBeginUser;
  for (PetscInt i = 0; i < b->ncount; i++)
    if (b->counted[i] > 0 && b->count[i].summed) PetscCall(add_quantity(b, b->count[i].name, "_steps", b->counted[i]));
  PetscFunctionReturn(PETSC_SUCCESS);
}

typedef struct {
  Diagnostics b;
  PetscInt    at;
} NextQuantity;

static PetscErrorCode add_scalar_quantity(void *next, const char name[])
{
  NextQuantity *n = (NextQuantity *)next;

  PetscFunctionBeginUser;
  PetscCall(MonitorQuantity(n->b->monitor, name, n->b->value[n->b->scalar_column + n->at++]));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode DiagnosticsFinish(Diagnostics b)
{
  NextQuantity next = {b, 0};

  PetscFunctionBeginUser;
  PetscCall(add_counts(b));
  PetscCall(ScalarColumnsAdd(b->couple, b->mesh, add_scalar_quantity, &next));
  for (PetscInt i = 0; i < b->ncoefficient; i++) PetscCall(add_coefficient(b, b->coefficient + i));
  if (b->dp) PetscCall(add_quantity(b, "dp", "", b->value[b->dp_column]));
  for (PetscInt i = 0; i < 2 && b->swim_column >= 0; i++)
    PetscCall(add_quantity(b, i ? "slip_power" : "swimming_speed", "", b->value[b->swim_column + i]));
  for (PetscInt a = 0; b->flow_rate && a < b->loc->dim; a++) {
    const char suffix[] = {'_', (char)('x' + a), 0};

    PetscCall(add_quantity(b, "flow_force", suffix, b->value[b->flow_rate_column + a]));
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}
