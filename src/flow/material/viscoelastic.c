/* Viscoelastic fluids as a material (conformation.h has the equations and the step): what the polymer adds to the
   momentum of a cell, and what the rest of a flow asks of it. The scalar operator has the number that E is at rest, as
   part of the viscosity of the matrix, and where E is a tensor what that differs by. */
#include "compat.h"
#include "viscoelastic.h"
#include "base/log.h"
#include "mesh/carry.h"

Viscoelastic *FlowViscoelastic(const struct _p_Flow *f)
{
  return f->material == &FLOW_VISCOELASTIC ? f->material_data : NULL;
}

static inline Conformation conformation_of(const struct _p_Flow *f)
{
  return ((const Viscoelastic *)f->material_data)->conformation;
}

/* ---- forms ---- */

/* E of cell c, [dim*dim] */
static void get_stiffness(const struct _p_Flow *f, PetscInt c, PetscReal E[9])
{
  const PetscInt   dim = f->loc->dim, n = dim * dim;
  const PetscReal *tensor   = ConformationTensors(conformation_of(f)),
                  stiffness = ConformationImplicit(conformation_of(f));

  for (PetscInt k = 0; k < n; k++) E[k] = tensor ? tensor[c * n + k] : k % (dim + 1) ? 0 : stiffness;
}

/* tau and P(grad u^n) at the lattice points of cell c: [nb][dim*dim] each; returns whether a node is one of an
   outflow */
static PetscBool gather_polymer(const struct _p_Flow *f, PetscInt c, PetscReal tau[], PetscReal grad[])
{
  const PetscInt   nb = f->loc->nb, n = f->loc->dim * f->loc->dim, *node = f->loc->cell_node + c * nb;
  const PetscReal *stress   = ConformationStress(conformation_of(f)),
                  *gradient = ConformationGradient(conformation_of(f));
  const PetscBool *open     = ConformationOpen(conformation_of(f));
  PetscBool        any      = PETSC_FALSE;

  for (PetscInt j = 0; j < nb; j++) {
    any = (PetscBool)(any || open[node[j]]);
    for (PetscInt k = 0; k < n; k++) {
      tau[j * n + k]  = stress[node[j] * n + k];
      grad[j * n + k] = gradient[node[j] * n + k];
    }
  }
  MeshCellGather(f->loc, c, n, tau);
  MeshCellGather(f->loc, c, n, grad);
  return any;
}

/* tau [nb][dim*dim] becomes T: less what devss adds to the matrix */
static void combine_polymer(PetscInt n, PetscReal devss, const PetscReal grad[], PetscReal tau[])
{
  for (PetscInt k = 0; k < n && devss > 0; k++) tau[k] -= devss * grad[k];
}

/* s [dim*dim] += weight grad F */
static void add_product(PetscInt dim, PetscReal weight, PetscReal grad[3][3], const PetscReal F[9], PetscReal s[9])
{
  for (PetscInt a = 0; a < dim; a++)
    for (PetscInt b = 0; b < dim; b++)
      for (PetscInt e = 0; e < dim; e++) s[a * dim + b] += weight * grad[a][e] * F[e * dim + b];
}

static void add_residual(Flow f, PetscInt c, const ElementMetric *m, const PetscReal ul[], PetscReal r[])
{
  const PetscInt   dim = f->loc->dim, nb = f->loc->nb, n = dim * dim, *node = f->loc->cell_node + c * nb;
  const PetscBool *open      = ConformationOpen(conformation_of(f));
  const PetscReal  stiffness = ConformationImplicit(conformation_of(f)), devss = ConformationDevss(conformation_of(f));
  PetscReal        T[MESH_MAX_NB * 9], G[MESH_MAX_NB * 9], E[9], F[9], un[MESH_MAX_NB * 3];
  PetscBool        any;

  if (f->cells.det[c] == 0) return;
  any = gather_polymer(f, c, T, G);
  MeshCellValues(f->loc, c, f->loc->dim, f->u, un);
  get_stiffness(f, c, E);
  PetscCallAbort(PETSC_COMM_SELF, PetscArraycpy(F, E, n));
  combine_polymer(nb * n, devss, G, T);
  for (PetscInt a = 0; a < dim; a++) {
    E[a * dim + a] -= stiffness;
    F[a * dim + a] -= devss;
  }
  for (PetscInt q = 0; q < f->element.nq; q++) {
    const PetscReal *phi  = f->element.phi + q * f->element.nbp;
    PetscReal        t[9] = {0}, s[9] = {0}, div[3] = {0, 0, 0}, grad[3][3];
    FlowGradients    g;

    ElementGradients(&f->element, m, q, g);
    for (PetscInt j = 0; j < nb; j++)
      for (PetscInt k = 0; k < n; k++) t[k] += m->weight[q] * phi[j] * T[j * n + k];
    for (PetscInt j = 0; j < nb && any; j++)
      for (PetscInt k = 0; k < n; k++) div[k / dim] += m->weight[q] * g[k % dim][j] * T[j * n + k];
    FlowVelocityGradient(f, g, un, grad);
    add_product(dim, -m->weight[q], grad, F, s);
    if (ul && FlowViscoelastic(f)->tensors) {
      FlowVelocityGradient(f, g, ul, grad);
      add_product(dim, m->weight[q], grad, E, s);
    }
    for (PetscInt j = 0; j < nb; j++)
      for (PetscInt k = 0; k < n; k++) {
        r[j * dim + k / dim] += s[k] * g[k % dim][j];
        if (!open[node[j]]) r[j * dim + k / dim] += t[k] * g[k % dim][j];
        else if (k % dim == 0) r[j * dim + k / dim] -= phi[j] * div[k / dim];
      }
  }
}

static void add_scalar(Flow f, PetscInt c, const ElementMetric *m, PetscReal ce[])
{
  const PetscInt  dim = f->loc->dim, nb = f->loc->nb, nbp = f->element.nbp;
  const PetscReal stiffness = ConformationImplicit(conformation_of(f));
  PetscReal       E[9];

  if (!FlowViscoelastic(f)->tensors || f->cells.det[c] == 0) return;
  get_stiffness(f, c, E);
  for (PetscInt a = 0; a < dim; a++) E[a * dim + a] -= stiffness;
  for (PetscInt q = 0; q < f->element.nq; q++) {
    const PetscReal scale = f->step.theta * m->weight[q];
    FlowGradients   g;

    ElementGradients(&f->element, m, q, g);
    for (PetscInt i = 0; i < nb; i++)
      for (PetscInt a = 0; a < dim; a++) {
        PetscReal along = 0;

        for (PetscInt b = 0; b < dim; b++) along += scale * E[a * dim + b] * g[b][i];
        for (PetscInt j = 0; j < nbp; j++) ce[i * nbp + j] += along * g[a][j];
      }
  }
}

static PetscReal get_stress(const struct _p_Flow *f, PetscInt c, const ElementMetric *m, PetscInt q,
                            PetscReal grad[3][3], PetscReal stress[3][3])
{
  const PetscInt   dim = f->loc->dim, nb = f->loc->nb, n = dim * dim;
  const PetscReal *phi = f->element.phi + q * f->element.nbp, devss = ConformationDevss(conformation_of(f));
  PetscReal        T[MESH_MAX_NB * 9], G[MESH_MAX_NB * 9], E[9], un[MESH_MAX_NB * 3], before[3][3], s[9] = {0};
  FlowGradients    g;

  (void)gather_polymer(f, c, T, G);
  combine_polymer(nb * n, devss, G, T);
  get_stiffness(f, c, E);
  add_product(dim, 1, grad, E, s);
  for (PetscInt a = 0; a < dim; a++) E[a * dim + a] -= devss;
  MeshCellValues(f->loc, c, f->loc->dim, f->u, un);
  ElementGradients(&f->element, m, q, g);
  FlowVelocityGradient(f, g, un, before);
  add_product(dim, -1, before, E, s);
  for (PetscInt a = 0; a < dim; a++)
    for (PetscInt b = 0; b < dim; b++) {
      stress[a][b] = s[a * dim + b];
      for (PetscInt j = 0; j < nb; j++) stress[a][b] += phi[j] * T[j * n + a * dim + b];
    }
  return f->par.solvent;
}

/* ---- what it amounts to ---- */

/* Force of the polymer at outflows on the own cells: rate [dim] += sum of its residual over all test functions, which
   is zero in cells without a node there */
static PetscErrorCode add_outflow(Flow f, PetscReal rate[])
{
  const MeshLocal *l    = f->loc;
  const PetscBool *open = ConformationOpen(conformation_of(f));

  PetscFunctionBeginUser;
  for (PetscInt c = 0; c < l->ncell; c++) {
    PetscReal     r[MESH_MAX_NB * 3] = {0};
    PetscBool     any                = PETSC_FALSE;
    ElementMetric m;

    for (PetscInt j = 0; j < l->nb; j++) any = (PetscBool)(any || open[l->cell_node[c * l->nb + j]]);
    if (!any) continue;
    PetscCall(FlowCellMetric(f, c, &m));
    add_residual(f, c, &m, NULL, r);
    for (PetscInt i = 0; i < l->nb * l->dim; i++) rate[i % l->dim] += r[i];
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode measure_elasticity(Flow f)
{
  const MeshLocal *l      = f->loc;
  const PetscReal *psi    = ConformationPredicted(conformation_of(f));
  PetscReal        top[2] = {0, 0};
  FlowElasticity  *e      = &FlowViscoelastic(f)->state;

  PetscFunctionBeginUser;
  e->energy = 0;
  for (PetscInt i = 0; i < l->nnode; i++) {
    PetscReal energy, trace, c_min;

    if (f->cells.lumped[i] <= 0) continue;
    PolymerState(&FlowViscoelastic(f)->law, l->dim, psi + 2 * l->dim * i, &energy, &trace, &c_min);
    e->energy += f->cells.lumped[i] * energy;
    top[0] = PetscMax(top[0], trace);
    top[1] = PetscMax(top[1], 1 / c_min);
  }
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, &e->energy, 1, MPIU_REAL, MPIU_SUM, f->comm));
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, top, 2, MPIU_REAL, MPIU_MAX, f->comm));
  e->trace = top[0];
  e->c_min = top[1] > 0 ? 1 / top[1] : 1;
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode diagnose(Flow f, PetscReal force[])
{
  PetscFunctionBeginUser;
  PetscCall(add_outflow(f, force));
  PetscCall(measure_elasticity(f));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode FlowGetElasticity(Flow f, const FlowElasticity **elastic)
{
  Viscoelastic *v = FlowViscoelastic(f);

  PetscFunctionBeginUser;
  *elastic = v ? &v->state : NULL;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode FlowGetLogConformation(Flow f, PetscReal *psi[], PetscReal *shift[])
{
  const Viscoelastic *v = FlowViscoelastic(f);

  PetscFunctionBeginUser;
  if (shift) *shift = v ? ConformationShift(v->conformation) : NULL;
  *psi = v ? ConformationField(v->conformation) : NULL;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode FlowGetConformation(Flow f, PetscReal c[])
{
  const PetscInt      dim = f->loc->dim;
  const Viscoelastic *v   = FlowViscoelastic(f);
  const PetscReal    *psi;

  PetscFunctionBeginUser;
  PetscCheck(v, PETSC_COMM_SELF, PETSC_ERR_ARG_WRONGSTATE, "The fluid is not viscoelastic");
  psi = ConformationField(v->conformation);
  for (PetscInt i = 0; i < f->loc->nnode_all; i++) {
    PetscReal C[3][3];

    PolymerConformation(dim, psi + 2 * dim * i, C);
    for (PetscInt a = 0, k = 0; a < 3; a++)
      for (PetscInt b = a; b < 3; b++) c[6 * i + k++] = C[a][b];
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- a step ---- */

static PetscErrorCode begin(Flow f, PetscReal dt)
{
  Viscoelastic   *v      = f->material_data;
  const PetscReal before = f->par.matrix;
  PetscBool       tensors;

  PetscFunctionBeginUser;
  PetscCall(ConformationBegin(v->conformation, dt));
  f->par.matrix = f->par.solvent + ConformationImplicit(v->conformation);
  tensors       = (PetscBool)(ConformationTensors(v->conformation) != NULL);
  if (f->par.matrix != before || tensors || v->tensors) f->matrix.ct = 0; /* another matrix */
  v->tensors = tensors;
  PetscFunctionReturn(PETSC_SUCCESS);
}

static void outdate(Flow f)
{
  ConformationForget(conformation_of(f));
}

static PetscErrorCode update(Flow f)
{
  PetscFunctionBeginUser;
  PetscCall(ConformationPredict(conformation_of(f)));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode accept(Flow f, const PetscReal u[])
{
  PetscFunctionBeginUser;
  PetscCall(ConformationAccept(conformation_of(f), u));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- life cycle ---- */

static PetscErrorCode create(Flow f)
{
  Viscoelastic *v = f->material_data;

  PetscFunctionBeginUser;
  PetscCall(ConformationCreate(f, &v->law, &v->conformation));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode remesh(Flow f, Mesh old)
{
  Viscoelastic *v   = f->material_data;
  Conformation  was = v->conformation;

  PetscFunctionBeginUser;
  PetscCall(create(f));
  PetscCall(MeshCarryNodes(old, f->mesh, 2 * f->loc->dim, ConformationField(was), ConformationField(v->conformation)));
  PetscCall(ConformationDestroy(&was));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode destroy(Flow f)
{
  Viscoelastic *v = f->material_data;

  PetscFunctionBeginUser;
  PetscCall(ConformationDestroy(&v->conformation));
  PetscCall(PetscFree(f->material_data));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode check(Flow f, const char scheme[], PetscBool end_of_step)
{
  PetscFunctionBeginUser;
  PetscCheck(end_of_step, f->comm, PETSC_ERR_USER_INPUT,
             "Option -flow_time %s: the stress of -flow_rheology %s belongs to the end of a step: use -flow_time bdf2 or be",
             scheme, FlowViscoelastic(f)->law.name);
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode refuse_steady(Flow f)
{
  const Polymer *law = &FlowViscoelastic(f)->law;

  SETERRQ(f->comm, PETSC_ERR_SUP,
          "-flow_rheology %s remembers what was, and finds its steady state in time alone: remove -sim_steady (and -flow_initial steady), and run with -sim_dt for "
          "some ten times -flow_rheology_time %g",
          law->name, (double)law->time);
}

static PetscErrorCode visit(Flow f, State state)
{
  PetscBool has;

  PetscFunctionBeginUser;
  PetscCall(StateHas(state, "log_conformation", &has));
  if (has) PetscCall(StateNodes(state, "log_conformation", 2 * f->loc->dim, ConformationField(conformation_of(f))));
  else PetscCall(LogRemark("the checkpoint has no stress of a polymer: it begins as at rest"));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode view(Flow f, PetscViewer viewer)
{
  PetscFunctionBeginUser;
  PetscCall(PolymerView(&FlowViscoelastic(f)->law, viewer));
  PetscFunctionReturn(PETSC_SUCCESS);
}

const FlowMaterial FLOW_VISCOELASTIC = {
  .name          = "viscoelastic",
  .create        = create,
  .remesh        = remesh,
  .destroy       = destroy,
  .check         = check,
  .refuse_steady = refuse_steady,
  .begin         = begin,
  .outdate       = outdate,
  .update        = update,
  .accept        = accept,
  .residual      = add_residual,
  .scalar        = add_scalar,
  .stress        = get_stress,
  .diagnose      = diagnose,
  .visit         = visit,
  .view          = view,
};
