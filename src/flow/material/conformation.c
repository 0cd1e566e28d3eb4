/* Conformation: see conformation.h. */
#include "compat.h"
#include "../impl.h"
#include "conformation.h"
#include "project.h"
#include "base/inline.h"
#include "base/log.h"

#define COURANT  0.5  /* largest displacement in a substep in distances of nodes, summed over the axes of the cell */
#define RATE     0.7  /* largest change of psi in a substep by its own rates */
#define SUBSTEPS 200  /* more are no use: the step is far beyond what the stress can follow */
#define EXPLICIT 0.5  /* largest explicit share of the stretched stiffness in the viscosity */
#define LARGEST  23.0 /* of |psi|: conformations beyond 1e10 */

struct _p_Conformation {
  Flow       f;
  Polymer    law;
  Projection projection;
  PetscInt   nc; /* 2 dim */
  PetscBool  current;
  PetscBool *inflow, *open;    /* [nnode_all] */
  PetscReal *psi, *next;       /* [nnode_all][nc] psi^n, psi* */
  PetscReal *shift;            /* [nnode_all][nc] of psi^n at surfaces (ConformationShift) */
  PetscReal *tau;              /* [nnode_all][dim*dim] tau(psi*) */
  PetscReal *tensor;           /* [ncell_all][dim*dim] E, where it is one */
  PetscBool  stretched;        /* it is */
  PetscReal  implicit;         /* what it is at rest */
  PetscReal *grad[2];          /* [nnode_all][dim*dim] P(grad u) at the beginning and at the end */
  PetscReal *w[2];             /* [nnode_all][dim] convecting velocity likewise */
  PetscReal *stage, *rate, *g; /* [nnode_all][nc] */
};

/* ---- rates ---- */

/* Convection of the cell's psi pl [nb][nc] with wl [nb][dim] at a quadrature point: a [nc] = w . grad psi, and
   derivative [nb] = w . grad phi; returns the speed in distances of nodes, summed over the axes */
INLINE PetscReal convect(const PetscInt dim, const PetscInt nb, const PetscInt nc, const struct _p_Flow *f,
                         const ElementMetric *m, PetscInt q, const PetscReal wl[], const PetscReal pl[], PetscReal a[],
                         PetscReal derivative[])
{
  const PetscReal *phi = f->element.phi + q * f->element.nbp, *dphi = f->element.dphi + q * dim * f->element.nbp,
                  *inverse = ElementInverse(m, q);
  PetscReal w[3] = {0, 0, 0}, along[3], speed = 0;

  for (PetscInt j = 0; j < nb; j++)
    for (PetscInt b = 0; b < dim; b++) w[b] += phi[j] * wl[j * dim + b];
  for (PetscInt e = 0; e < dim; e++) {
    along[e] = 0; /* reference coordinates a time */
    for (PetscInt b = 0; b < dim; b++) along[e] += inverse[e * dim + b] * w[b];
    speed += PetscAbsReal(along[e]);
  }
  for (PetscInt k = 0; k < nc; k++) a[k] = 0;
  for (PetscInt j = 0; j < nb; j++) {
    derivative[j] = 0;
    for (PetscInt e = 0; e < dim; e++) derivative[j] += along[e] * dphi[e * f->element.nbp + j];
    for (PetscInt k = 0; k < nc; k++) a[k] += derivative[j] * pl[j * nc + k];
  }
  return speed;
}

/* Adds the integrals of project_convection over a cell to rl [nb][nc] */
INLINE void integrate_convection(const PetscInt dim, const PetscInt nb, const PetscInt nc, const struct _p_Flow *f,
                                 const ElementMetric *m, const PetscReal wl[], const PetscReal pl[],
                                 const PetscReal *restrict gl, PetscReal *restrict rl)
{
  for (PetscInt q = 0; q < f->element.nq; q++) {
    const PetscReal *phi = f->element.phi + q * f->element.nbp;
    PetscReal a[POLYMER_MAX_NC], derivative[MESH_MAX_NB], speed = convect(dim, nb, nc, f, m, q, wl, pl, a, derivative);

    for (PetscInt j = 0; j < nb && gl; j++)
      for (PetscInt k = 0; k < nc; k++) a[k] -= phi[j] * gl[j * nc + k];
    for (PetscInt j = 0; j < nb; j++) {
      const PetscReal test = m->weight[q] * (gl ? (speed > 0 ? 0.25 / speed * derivative[j] : 0) : phi[j]);

      for (PetscInt k = 0; k < nc; k++) rl[j * nc + k] += test * a[k];
    }
  }
}

/* r = P(w . grad psi) (g NULL), or the stabilisation P(tau (w . grad psi - g), w . grad v) */
static PetscErrorCode project_convection(Conformation s, const PetscReal w[], const PetscReal psi[],
                                         const PetscReal g[], PetscReal r[])
{
  const struct _p_Flow *f  = s->f;
  const MeshLocal      *l  = f->loc;
  const PetscInt        nc = s->nc;

  PetscFunctionBeginUser;
  PetscCall(PetscArrayzero(r, l->nnode_all * nc));
  for (PetscInt c = 0; c < l->ncell_all; c++) {
    PetscReal wl[MESH_MAX_NB * 3], pl[MESH_MAX_NB * POLYMER_MAX_NC], gl[MESH_MAX_NB * POLYMER_MAX_NC],
      rl[MESH_MAX_NB * POLYMER_MAX_NC];
    ElementMetric m;

    if (f->cells.det[c] == 0) continue;
    MeshCellValues(l, c, l->dim, w, wl);
    MeshCellValues(l, c, nc, psi, pl);
    if (g) MeshCellValues(l, c, nc, g, gl);
    PetscCall(ProjectionMetric(&s->projection, c, &m));
    PetscCall(PetscArrayzero(rl, l->nb * nc));
    if (l->dim == 2) integrate_convection(2, 9, 4, f, &m, wl, pl, g ? gl : NULL, rl);
    else integrate_convection(3, 27, 6, f, &m, wl, pl, g ? gl : NULL, rl);
    ProjectionScatter(l, c, nc, rl, r);
  }
  PetscCall(ProjectionFinish(&s->projection, nc, r));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Velocity gradient and convecting velocity of node i at the fraction `at` of the step */
static void interpolate(const struct _p_Conformation *s, PetscInt i, PetscReal at, PetscReal L[3][3])
{
  const PetscInt dim = s->f->loc->dim;

  for (PetscInt a = 0; a < 3; a++)
    for (PetscInt b = 0; b < 3; b++) {
      const PetscInt k = (i * dim + a) * dim + b;

      L[a][b] = a < dim && b < dim ? (1 - at) * s->grad[0][k] + at * s->grad[1][k] : 0;
    }
  if (!s->inflow[i]) return;
  PetscReal w[3] = {0, 0, 0}, square = 0;

  for (PetscInt a = 0; a < dim; a++) {
    w[a] = (1 - at) * s->w[0][i * dim + a] + at * s->w[1][i * dim + a];
    square += w[a] * w[a];
  }
  for (PetscInt a = 0; a < dim && square > 0; a++) { /* without the derivative along the streamline */
    PetscReal along = 0;

    for (PetscInt b = 0; b < dim; b++) along += L[a][b] * w[b] / square;
    for (PetscInt b = 0; b < dim; b++) L[a][b] -= along * w[b];
  }
}

/* Points of a surface keep their psi: what it was shifted by goes back in the course of the step, in place of
   convection, whose one-sided differences let such nodes swing (runs/studies/rheology). Returns whether i is one. */
static PetscBool shift_back(const struct _p_Conformation *s, PetscInt i, PetscReal rate[])
{
  const PetscReal *shift = s->shift + i * s->nc;
  PetscBool        any   = PETSC_FALSE;

  for (PetscInt k = 0; k < s->nc; k++) {
    rate[k] -= shift[k] / s->f->step.dt;
    any = (PetscBool)(any || shift[k] != 0);
  }
  return any;
}

/* Is node i one of a surface and at rest? Nothing is convected there; the projections say so to their order alone. */
static PetscBool is_at_rest(const struct _p_Conformation *s, PetscInt i, const PetscReal w[])
{
  const PetscInt dim   = s->f->loc->dim;
  PetscBool      moves = PETSC_FALSE;

  for (PetscInt a = 0; a < dim; a++) moves = (PetscBool)(moves || w[i * dim + a] != 0);
  return (PetscBool)(!moves && ProjectionIsSurface(&s->projection, i));
}

/* rate [nnode_all][nc] of psi at the fraction `at` of the step, synced */
static PetscErrorCode compute_rate(Conformation s, PetscReal at, const PetscReal psi[], PetscReal w[], PetscReal rate[])
{
  const MeshLocal *l  = s->f->loc;
  const PetscInt   nc = s->nc;

  PetscFunctionBeginUser;
  for (PetscInt i = 0; i < l->nnode_all * l->dim; i++) w[i] = (1 - at) * s->w[0][i] + at * s->w[1][i];
  PetscCall(project_convection(s, w, psi, NULL, s->g));
  PetscCall(project_convection(s, w, psi, s->g, rate));
  for (PetscInt i = 0; i < l->nnode_all; i++) {
    PetscReal local[POLYMER_MAX_NC], L[3][3], speed;

    interpolate(s, i, at, L);
    PolymerRate(&s->law, l->dim, psi + i * nc, L, local, &speed);
    if (!shift_back(s, i, local) && !s->inflow[i] && !is_at_rest(s, i, w))
      for (PetscInt k = 0; k < nc; k++) local[k] -= s->g[i * nc + k] + rate[i * nc + k];
    PetscCall(PetscArraycpy(rate + i * nc, local, nc));
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- a step ---- */

/* Substeps that a step of length dt needs */
static PetscErrorCode count_substeps(Conformation s, PetscReal dt, PetscInt *n)
{
  const struct _p_Flow *f   = s->f;
  const MeshLocal      *l   = f->loc;
  PetscReal             top = 0;

  PetscFunctionBeginUser;
  for (PetscInt side = 0; side < 2; side++) {
    for (PetscInt c = 0; c < l->ncell; c++) {
      PetscReal     wl[MESH_MAX_NB * 3], a[POLYMER_MAX_NC], derivative[MESH_MAX_NB];
      ElementMetric m;

      if (f->cells.det[c] == 0) continue;
      MeshCellValues(l, c, l->dim, s->w[side], wl);
      PetscCall(FlowCellMetric(s->f, c, &m));
      for (PetscInt q = 0; q < f->element.nq; q++)
        top = PetscMax(top, convect(l->dim, l->nb, 0, f, &m, q, wl, NULL, a, derivative) / COURANT);
    }
    for (PetscInt i = 0; i < l->nnode; i++) {
      PetscReal rate[POLYMER_MAX_NC], L[3][3], speed;

      if (s->projection.mass[i] <= 0) continue;
      interpolate(s, i, side, L);
      PolymerRate(&s->law, l->dim, s->psi + i * s->nc, L, rate, &speed);
      top = PetscMax(top, speed / RATE);
    }
  }
  top *= dt;
  if (PetscIsInfOrNanReal(top)) top = 10 * SUBSTEPS;
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, &top, 1, MPIU_REAL, MPIU_MAX, s->f->comm));
  PetscCheck(top < SUBSTEPS, s->f->comm, PETSC_ERR_NOT_CONVERGED,
             "The conformation of -flow_rheology %s would need more than %d substeps in the step to t = %g, whose length is %g: the flow changes too fast "
             "for it, or has blown up. Lower -sim_dt, or lower -flow_rheology_time",
             s->law.name, SUBSTEPS, (double)f->step.time, (double)dt);
  *n = PetscMax(1, (PetscInt)PetscCeilReal(top));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Is psi of the own nodes finite, within bounds, and within what the law knows? */
static PetscErrorCode check_field(Conformation s, const PetscReal psi[])
{
  const MeshLocal *l      = s->f->loc;
  PetscReal        top[2] = {0, 0}; /* |psi|; beyond the extensibility */

  PetscFunctionBeginUser;
  for (PetscInt i = 0; i < l->nnode; i++) {
    PetscReal trace = 0;

    for (PetscInt k = 0; k < s->nc; k++) {
      const PetscReal value = PetscAbsReal(psi[i * s->nc + k]);

      top[0] = value < LARGEST ? PetscMax(top[0], value) : 2 * LARGEST; /* also for NaN */
    }
    if (s->law.extensibility <= 0 || top[0] > LARGEST) continue;
    PolymerState(&s->law, l->dim, psi + i * s->nc, NULL, &trace, NULL);
    top[1] = PetscMax(top[1], trace / s->law.extensibility);
  }
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, top, 2, MPIU_REAL, MPIU_MAX, s->f->comm));
  PetscCheck(top[0] < LARGEST, s->f->comm, PETSC_ERR_NOT_CONVERGED,
             "The conformation of -flow_rheology %s has blown up in the step to t = %g: eigenvalues beyond 1e10. Lower -sim_dt (the step was %g), refine the mesh, or "
             "lower -flow_rheology_time; -flow_rheology fene_p or giesekus bound the stretch",
             s->law.name, (double)s->f->step.time, (double)s->f->step.dt);
  PetscCheck(top[1] < 1, s->f->comm, PETSC_ERR_NOT_CONVERGED,
             "The polymer of -flow_rheology fene_p is stretched beyond -flow_rheology_extensibility %g in the step to t = %g: lower -sim_dt (the step was %g), or raise "
             "-flow_rheology_extensibility",
             (double)s->law.extensibility, (double)s->f->step.time, (double)s->f->step.dt);
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* psi^n over the step, in substeps, with gradients and velocities linear in time: to [nnode_all][nc], not psi */
static PetscErrorCode advance(Conformation s, PetscReal dt, PetscReal to[])
{
  static const PetscReal WEIGHT[3] = {1, 0.25, 2. / 3}, AT[3] = {0, 1, 0.5}; /* Shu & Osher 1988 */
  const MeshLocal       *l = s->f->loc;
  const PetscInt         n = l->nnode_all * s->nc;
  PetscInt               nsub;
  PetscReal             *w;

  PetscFunctionBeginUser;
  PetscCall(count_substeps(s, dt, &nsub));
  PetscCall(PetscMalloc1(l->nnode_all * l->dim, &w));
  PetscCall(PetscArraycpy(to, s->psi, n));
  for (PetscInt t = 0; t < nsub; t++) {
    PetscCall(PetscArraycpy(s->stage, to, n));
    for (PetscInt k = 0; k < 3; k++) {
      PetscCall(compute_rate(s, (t + AT[k]) / nsub, s->stage, w, s->rate));
      for (PetscInt i = 0; i < n; i++)
        s->stage[i] = (1 - WEIGHT[k]) * to[i] + WEIGHT[k] * (s->stage[i] + dt / nsub * s->rate[i]);
    }
    PetscCall(PetscArraycpy(to, s->stage, n));
  }
  PetscCall(PetscFree(w));
  PetscCall(check_field(s, to));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Velocity that convects psi when the fluid has u: seen from the nodes */
static void set_convection(Conformation s, const PetscReal u[], PetscReal w[])
{
  const struct _p_Flow *f = s->f;

  for (PetscInt i = 0; i < f->loc->nnode_all * f->loc->dim; i++)
    w[i] = u[i] - (f->mesh_velocity ? f->mesh_velocity[i] : 0) - f->step.frame[i % f->loc->dim];
}

void ConformationForget(Conformation s)
{
  s->current = PETSC_FALSE;
}

/* Largest eigenvalue of f c among the own nodes of all ranks */
static PetscErrorCode find_stretch(Conformation s, PetscReal *stretch)
{
  const MeshLocal *l = s->f->loc;

  PetscFunctionBeginUser;
  *stretch = 1;
  for (PetscInt i = 0; i < l->nnode; i++) {
    PetscReal c[3][3];

    PolymerStiffness(&s->law, l->dim, s->psi + i * s->nc, c);
    *stretch = PetscMax(*stretch, c[0][0] + c[1][1] + c[2][2] - 2); /* never less, and the same at rest */
  }
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, stretch, 1, MPIU_REAL, MPIU_MAX, s->f->comm));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ConformationBegin(Conformation s, PetscReal dt)
{
  const Polymer  *p       = &s->law;
  const PetscReal gain    = p->viscosity * PetscMin(1, dt / p->time);
  PetscReal       stretch = 0;

  PetscFunctionBeginUser;
  s->current   = PETSC_FALSE;
  s->implicit  = p->viscosity * p->devss + (p->implicit == POLYMER_NONE ? 0 : gain);
  s->stretched = (PetscBool)(p->implicit == POLYMER_STRETCHED);
  if (p->implicit == POLYMER_AUTO) PetscCall(find_stretch(s, &stretch));
  if (p->implicit == POLYMER_AUTO)
    s->stretched = (PetscBool)(gain * (stretch - 1) > EXPLICIT * (p->solvent + s->implicit));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscReal ConformationImplicit(Conformation s)
{
  return s->implicit;
}

PetscReal ConformationDevss(Conformation s)
{
  return s->law.viscosity * s->law.devss;
}

const PetscReal *ConformationTensors(Conformation s)
{
  return s->stretched ? s->tensor : NULL;
}

/* E of the cells: with f c of the node where it is largest. A mean is too little for a node at a surface, where c falls
   to a fraction within a cell (runs/studies/rheology). */
static PetscErrorCode compute_tensors(Conformation s)
{
  const MeshLocal *l   = s->f->loc;
  const PetscInt   dim = l->dim, n = dim * dim;
  const PetscReal  gain = s->law.viscosity * PetscMin(1, s->f->step.dt / s->law.time);
  PetscReal       *c, *trace;

  PetscFunctionBeginUser;
  if (!s->stretched) PetscFunctionReturn(PETSC_SUCCESS);
  if (!s->tensor) PetscCall(PetscMalloc1(l->ncell_all * n, &s->tensor));
  PetscCall(PetscMalloc2(l->nnode_all * n, &c, l->nnode_all, &trace));
  for (PetscInt i = 0; i < l->nnode_all; i++) {
    PetscReal here[3][3];

    PolymerStiffness(&s->law, dim, s->psi + i * s->nc, here);
    trace[i] = 0;
    for (PetscInt k = 0; k < n; k++) c[i * n + k] = here[k / dim][k % dim];
    for (PetscInt a = 0; a < dim; a++) trace[i] += here[a][a];
  }
  for (PetscInt e = 0; e < l->ncell_all; e++) {
    const PetscInt *node = l->cell_node + e * l->nb; /* slots: of a hanging node the one that it hangs on */
    PetscInt        top  = node[0];

    for (PetscInt j = 1; j < l->nb; j++)
      if (trace[node[j]] > trace[top]) top = node[j];
    for (PetscInt k = 0; k < n; k++)
      s->tensor[e * n + k] = gain * c[top * n + k] + (k % (dim + 1) ? 0 : s->implicit - gain);
  }
  PetscCall(PetscFree2(c, trace));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ConformationPredict(Conformation s)
{
  const struct _p_Flow *f   = s->f;
  const PetscInt        dim = f->loc->dim, n = dim * dim;

  PetscFunctionBeginUser;
  if (s->current) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(PetscLogEventBegin(TB_FLOW_STRESS, 0, 0, 0, 0));
  PetscCall(ProjectionUpdate(&s->projection));
  PetscCall(ProjectionGradient(&s->projection, f->u, s->grad[0]));
  PetscCall(PetscArraycpy(s->grad[1], s->grad[0], f->loc->nnode_all * n));
  set_convection(s, f->u, s->w[0]);
  PetscCall(PetscArraycpy(s->w[1], s->w[0], f->loc->nnode_all * dim));
  PetscCall(advance(s, f->step.dt, s->next));
  for (PetscInt i = 0; i < f->loc->nnode_all; i++) {
    PetscReal tau[3][3];

    PolymerStress(&s->law, dim, s->next + i * s->nc, tau);
    for (PetscInt k = 0; k < n; k++) s->tau[i * n + k] = tau[k / dim][k % dim];
  }
  PetscCall(compute_tensors(s));
  s->current = PETSC_TRUE;
  PetscCall(PetscLogEventEnd(TB_FLOW_STRESS, 0, 0, 0, 0));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ConformationAccept(Conformation s, const PetscReal u[])
{
  PetscReal *swap = s->psi;

  PetscFunctionBeginUser;
  PetscCall(PetscLogEventBegin(TB_FLOW_STRESS, 0, 0, 0, 0));
  PetscCall(ProjectionGradient(&s->projection, u, s->grad[1]));
  set_convection(s, u, s->w[1]);
  PetscCall(advance(s, s->f->step.dt, s->next));
  s->psi  = s->next;
  s->next = swap;
  PetscCall(PetscArrayzero(s->shift, s->f->loc->nnode_all * s->nc));
  s->current = PETSC_FALSE;
  PetscCall(PetscLogEventEnd(TB_FLOW_STRESS, 0, 0, 0, 0));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- life cycle ---- */

static PetscErrorCode mark_openings(Conformation s)
{
  const unsigned char *fixed, *wall;
  PetscInt             n;

  PetscFunctionBeginUser;
  PetscCall(ConditionsGetValues(s->f->boundary, &fixed, NULL));
  PetscCall(ConditionsGetWalls(s->f->boundary, &wall));
  PetscCall(MeshGetBoundaryCount(s->f->mesh, &n));
  for (PetscInt b = 0; b < n; b++) {
    const PetscInt *node;
    PetscInt        nnode;
    PetscBool       is_wall, open, outflow;

    PetscCall(ConditionsGetKind(s->f->boundary, b, &is_wall, &open));
    PetscCall(ConditionsIsOutflow(s->f->boundary, b, &outflow));
    PetscCall(MeshGetBoundaryNodes(s->f->mesh, b, &nnode, &node));
    for (PetscInt i = 0; i < nnode && open; i++) {
      s->open[node[i]]   = (PetscBool)(s->open[node[i]] || outflow);
      s->inflow[node[i]] = (PetscBool)(s->inflow[node[i]] || (!outflow && !wall[node[i]] && fixed[node[i]]));
    }
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ConformationCreate(Flow f, const Polymer *law, Conformation *conformation)
{
  const PetscInt dim = f->loc->dim, n = f->loc->nnode_all, nc = 2 * dim;
  Conformation   s;

  PetscFunctionBeginUser;
  PetscCall(PetscNew(&s));
  s->f   = f;
  s->law = *law;
  s->nc  = nc;
  PetscCall(PetscCalloc2(n, &s->inflow, n, &s->open));
  PetscCall(PetscCalloc1(n * nc, &s->psi)); /* each on its own: accepted steps swap them */
  PetscCall(PetscCalloc1(n * nc, &s->next));
  PetscCall(PetscCalloc1(n * nc, &s->shift));
  PetscCall(PetscCalloc5(n * dim * dim, &s->tau, n * dim * dim, &s->grad[0], n * dim * dim, &s->grad[1], n * dim,
                         &s->w[0], n * dim, &s->w[1]));
  PetscCall(PetscCalloc3(n * nc, &s->stage, n * nc, &s->rate, n * nc, &s->g));
  PetscCall(mark_openings(s));
  PetscCall(ProjectionCreate(f, &s->projection));
  *conformation = s;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ConformationDestroy(Conformation *conformation)
{
  Conformation s = *conformation;

  PetscFunctionBeginUser;
  if (!s) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(ProjectionDestroy(&s->projection));
  PetscCall(PetscFree2(s->inflow, s->open));
  PetscCall(PetscFree(s->psi));
  PetscCall(PetscFree(s->next));
  PetscCall(PetscFree(s->shift));
  PetscCall(PetscFree(s->tensor));
  PetscCall(PetscFree5(s->tau, s->grad[0], s->grad[1], s->w[0], s->w[1]));
  PetscCall(PetscFree3(s->stage, s->rate, s->g));
  PetscCall(PetscFree(*conformation));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscReal *ConformationField(Conformation s)
{
  return s->psi;
}

PetscReal *ConformationShift(Conformation s)
{
  return s->shift;
}

const PetscReal *ConformationPredicted(Conformation s)
{
  return s->next;
}

const PetscReal *ConformationStress(Conformation s)
{
  return s->tau;
}

const PetscReal *ConformationGradient(Conformation s)
{
  return s->grad[0];
}

const PetscBool *ConformationOpen(Conformation s)
{
  return s->open;
}
