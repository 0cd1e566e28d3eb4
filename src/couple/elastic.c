/* Elastic: see elastic.h; the participant. */
#include "compat.h"
#include "elastic.h"
#include "elasticgap.h"
#include "elasticinside.h"
#include "impl.h"
#include "base/log.h"
#include "base/opt.h"
#include "bodies/local.h"
#include "bodies/mass.h"
#include "couple/participant.h"

#define FAR        2    /* over the way that a step stands */
#define ON_SURFACE 1e-6 /* of the smallest cell: such nodes are on a rigid body */

/* ---- life cycle ---- */

/* Rows of the matrix of the solids, and what goes by them */
static PetscErrorCode create_rows(Elastic *e, MPI_Comm comm)
{
  const PetscInt dim = e->s->dim;

  PetscFunctionBeginUser;
  PetscCall(ElasticCreateMatrix(e, comm));
  PetscCall(MatGetOwnershipRange(e->K, &e->nodes[0], &e->nodes[1]));
  for (PetscInt i = 0; i < 2; i++) e->nodes[i] /= dim;
  PetscCall(MatCreateVecs(e->K, NULL, &e->us));
  PetscCall(VecDuplicate(e->us, &e->fs));
  PetscCall(VecScatterCreateToAll(e->us, &e->gather, &e->all));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode discard(Couple c, void *data)
{
  Elastic *e = (Elastic *)data;

  PetscFunctionBeginUser;
  (void)c;
  PetscCall(MatDestroy(&e->P));
  PetscCall(PetscFree(e->force));
  PetscCall(ElasticTensionsDiscard(e));
  PetscCall(PetscFree(e->lumped));
  PetscCall(PetscFree(e->viscosity));
  PetscCall(ElasticInertiaDestroy(&e->inertia));
  PetscCall(ElasticAlignDestroy(&e->align));
  PetscCall(PetscFree3(e->carried.way, e->carried.shift, e->carried.velocity));
  PetscCall(ElasticAleDestroy(&e->ale));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode keep_of_mesh(Couple c, void *data)
{
  Elastic *e = (Elastic *)data;

  PetscFunctionBeginUser;
  (void)c;
  if (e->align) PetscCall(ElasticAlignBeforeRemesh(e->align, &e->left));
  e->lineup.done = PETSC_FALSE;
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* A cell inside a membrane has the viscosity of what that encloses (-particle_<group>_viscosity), one that it cuts the
   mean by volume. Of membranes one inside the other the later in the list of solids is the inner one. */
static PetscErrorCode find_viscosity(Elastic *e, Couple c)
{
  ElasticInside    t;
  const PetscReal *inside;

  PetscFunctionBeginUser;
  PetscCall(ElasticInsideCreate(c->mesh, e->surfaces, e->align ? e->labels.lined : NULL, e->labels.cell_solid, &t));
  for (PetscInt i = 0; i < c->loc->ncell_all; i++) e->viscosity[i] = c->par->viscosity;
  for (PetscInt k = 0; k < e->s->n; k++) {
    const PetscReal inner = e->s->group[e->s->group_of[k]].inner_viscosity;

    if (inner == 0) continue;
    PetscCall(ElasticInsideFind(t, k, &inside));
    for (PetscInt i = 0; i < c->loc->ncell_all; i++) e->viscosity[i] += inside[i] * (inner - e->viscosity[i]);
  }
  PetscCall(ElasticInsideDestroy(&t));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Of the flow's cells, the surfaces being where they are now */
static PetscErrorCode set_properties(Elastic *e, Couple c)
{
  PetscFunctionBeginUser;
  if (e->viscosity) PetscCall(find_viscosity(e, c));
  PetscCall(FlowSetProperties(c->flow, e->align ? e->labels.density : NULL, e->viscosity));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* What -couple_method aligned has of a mesh */
static PetscErrorCode make_aligned(Elastic *e, Couple c, Mesh *old)
{
  AlignDriver beside = NULL;

  PetscFunctionBeginUser;
  PetscCheck(!old || !c->scalars, c->comm, PETSC_ERR_SUP,
             "-scalars with elastic particles on a mesh whose cells are rebuilt: nodes that go along with solids are not known on a new mesh: "
             "remove -mesh_track and -mesh_adapt");
  if (!e->aligned) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(PetscCalloc1(c->loc->nnode_all, &e->lumped));
  PetscCall(ElasticInertiaCreate(c->loc, &e->inertia));
  if (e->beside) beside = (*c->method.table->driver)(c->method.data);
  if (!e->rebase) PetscCall(ElasticAlignCreate(c->flow, c->mesh_update, e->s, e->surfaces, beside, &e->align));
  if (e->left) {
    PetscCall(ElasticAlignAfterRemesh(e->align, &e->left, old));
    PetscCall(ElasticAlignGetLabels(e->align, &e->labels));
  }
  PetscCall(ElasticCarryScalars(e, c));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode make_on_mesh(Couple c, void *data, Mesh *old)
{
  Elastic *e = (Elastic *)data;

  PetscFunctionBeginUser;
  PetscCall(PetscCalloc1(c->loc->nnode * c->loc->dim, &e->force));
  PetscCall(ElasticTensionsMakeOnMesh(e, c));
  PetscCall(make_aligned(e, c, old));
  if (!SolidsHaveInnerFluid(e->solids)) PetscFunctionReturn(PETSC_SUCCESS);
  /* the solver is to know that there are viscosities; those of a step come with its geometry */
  PetscCall(PetscMalloc1(c->loc->ncell_all, &e->viscosity));
  for (PetscInt i = 0; i < c->loc->ncell_all; i++) e->viscosity[i] = c->par->viscosity;
  PetscCall(FlowSetProperties(c->flow, NULL, e->viscosity));
  PetscCall(CoupleRenewSolver(c));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode destroy(Couple c, void *data)
{
  Elastic *e = (Elastic *)data;

  PetscFunctionBeginUser;
  PetscCall(discard(c, data));
  PetscCall(ElasticTensionsDestroy(e));
  PetscCall(MatDestroy(&e->K));
  PetscCall(VecDestroy(&e->us));
  PetscCall(VecDestroy(&e->fs));
  PetscCall(VecDestroy(&e->all));
  PetscCall(VecScatterDestroy(&e->gather));
  PetscCall(PetscFree7(e->x, e->a, e->u, e->end, e->load, e->change, e->kept));
  c->elastic = NULL;
  PetscCall(ElasticSurfacesDestroy(&e->surfaces));
  PetscCall(PetscFree(e->corner));
  for (PetscInt i = 0; i < 2; i++) {
    ElasticPoints *p = i ? &e->point : &e->node;

    PetscCall(PetscFree(p->cell));
    PetscCall(PetscFree(p->xi));
    PetscCall(PetscFree(p->reached));
  }
  PetscCall(PetscFree(e->volumes.cell));
  PetscCall(PetscFree(e->volumes.C));
  PetscCall(PetscFree(e->volumes.g));
  PetscCall(PetscFree(e->contacts.list));
  PetscCall(PetscFree(e->contacts.near));
  PetscCall(PetscFree(e->contacts.image));
  PetscCall(PetscFree(e->within));
  PetscCall(PetscFree(e));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- the step ---- */

/* The boundary method lines the mesh up with them, if with rigid bodies that move, in every step */
static PetscErrorCode predict(Couple c, void *data)
{
  Elastic *e = (Elastic *)data;

  PetscFunctionBeginUser;
  PetscCheck(c->step->dt > 0 && c->step->theta == 1, c->comm, PETSC_ERR_SUP,
             "Elastic particles move in time steps of -flow_time be or bdf2: choose one of them, without -sim_steady");
  PetscCall(ElasticPredict(e, c));
  if (!e->beside) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(ElasticAlignPlace(e->align, e->x));
  c->method.others = PETSC_TRUE;
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Nodes in rigid bodies, which stand still, and on their surfaces; by distance, since a checkpoint is loaded before the
   constraint knows them */
static PetscErrorCode mark_rigid(Couple c, PetscInt body[])
{
  const MeshLocal *l = c->loc;
  PetscReal       *d;

  PetscFunctionBeginUser;
  PetscCall(PetscMalloc1(l->nnode_all, &d));
  for (PetscInt i = 0; i < l->nnode_all; i++) body[i] = -1;
  for (PetscInt k = 0; k < c->s->n; k++) {
    PetscCall(BodiesDistance(c->bodies, k, c->s->x[k], c->s->q[k], l->nnode_all, l->x, d));
    for (PetscInt i = 0; i < l->nnode_all; i++)
      if (d[i] < ON_SURFACE * l->h) body[i] = k;
  }
  PetscCall(PetscFree(d));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Next to rigid bodies that stand still and that the mesh is lined up with, once: that mesh is the one to begin with,
   and what is of them stays there */
static PetscErrorCode begin_on_lined_up(Elastic *e, Couple c)
{
  const PetscInt n = c->loc->nnode_all;
  PetscInt      *body;
  PetscBool     *held;

  PetscFunctionBeginUser;
  PetscCall(MeshRebase(c->mesh));
  PetscCall(ElasticAlignCreate(c->flow, c->mesh_update, e->s, e->surfaces, NULL, &e->align));
  PetscCall(PetscMalloc2(n, &body, n, &held));
  PetscCall(mark_rigid(c, body));
  for (PetscInt i = 0; i < n; i++) held[i] = (PetscBool)(body[i] >= 0);
  PetscCall(ElasticAlignHold(e->align, held));
  PetscCall(PetscFree2(body, held));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode create_ale(Elastic *e, Couple c)
{
  PetscInt *body;

  PetscFunctionBeginUser;
  PetscCall(PetscMalloc1(c->loc->nnode_all, &body));
  PetscCall(mark_rigid(c, body));
  PetscCall(ElasticAleCreate(c->flow, c->mesh_update, e->s, e->labels.cell_solid, body, &e->ale));
  PetscCall(PetscFree(body));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Solids that are held: lined up once, where they start */
static PetscErrorCode begin_anchored(Elastic *e, Couple c)
{
  PetscFunctionBeginUser;
  PetscCall(ElasticAlignUpdate(e->align, e->s->X, &e->labels));
  PetscCheck(!e->labels.immersed, c->comm, PETSC_ERR_USER_INPUT,
             "-couple_method aligned cannot line the mesh up with an elastic particle where it starts: give it two cells across at least, or use "
             "-couple_method penalty");
  PetscCall(set_properties(e, c));
  PetscCall(create_ale(e, c));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode prepare(Couple c, void *data)
{
  Elastic *e = (Elastic *)data;

  PetscFunctionBeginUser;
  if (e->rebase && !e->align) PetscCall(begin_on_lined_up(e, c));
  if (e->align && e->anchored && !e->ale) PetscCall(begin_anchored(e, c));
  PetscCall(ElasticStartPhases(e, c));
  if (e->ale) PetscCall(ElasticAleUpdate(e->ale, c->step, e->x));
  else if (e->align) PetscCall(ElasticLineUp(e, c));
  PetscCall(ElasticStartInside(e, c));
  PetscCall(ElasticSetPhases(e, c, e->x));
  PetscCall(ElasticMap(e, c));
  PetscCall(ElasticFindContacts(e, c));
  if ((e->align && !e->ale) || e->viscosity) PetscCall(set_properties(e, c));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode assemble(Couple c, void *data)
{
  PetscFunctionBeginUser;
  PetscCall(ElasticPushBodies((const Elastic *)data, c, c->rigid.g));
  PetscCall(ElasticAssemble((Elastic *)data, c));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* e->load [n][dim]: what each solid exerts on the flow where its velocity is not prescribed, by boundaries or rigid
   bodies (of free ones it is part of the force): (fs - K u_s) at its nodes times the part of them that moves with such
   nodes of the flow, and its inertia and weight, at all nodes (CoupleGetGiven). e->supplied: the power of what
   prescribes the others, against that */
static PetscErrorCode measure_force(Elastic *e, Couple c)
{
  const MeshLocal     *l   = c->loc;
  const PetscInt       dim = l->dim;
  const unsigned char *fixed;
  const PetscInt      *body;
  const PetscReal     *w, *r;
  PetscReal           *one;
  Vec                  free, weight, residual;

  PetscFunctionBeginUser;
  PetscCall(ConditionsGetValues(FlowConditions(c->flow), &fixed, NULL));
  PetscCall(ConstraintGetNodeBody(c->constraint, &body));
  PetscCall(PetscMalloc1(l->nnode_all * dim, &one));
  for (PetscInt i = 0; i < l->nnode_all * dim; i++) {
    const PetscInt k = body[i / dim];

    one[i] = k < 0 ? !((fixed[i / dim] >> (i % dim)) & 1) : (c->rigid.unknown[k] >> (i % dim)) & 1;
  }
  PetscCall(VecCreateMPIWithArray(c->comm, dim, l->nnode * dim, PETSC_DETERMINE, one, &free));
  PetscCall(VecDuplicate(e->us, &weight));
  PetscCall(VecDuplicate(e->us, &residual));
  PetscCall(MatMult(e->P, free, weight));
  PetscCall(MatMult(e->K, e->us, residual));
  PetscCall(VecAYPX(residual, -1, e->fs));
  PetscCall(PetscArrayzero(e->load, e->s->n * dim));
  PetscCall(VecGetArrayRead(weight, &w));
  PetscCall(VecGetArrayRead(residual, &r));
  for (PetscInt k = 0; k < e->s->n; k++)
    for (PetscInt i = PetscMax(e->nodes[0], e->s->first[k]); i < PetscMin(e->nodes[1], e->s->first[k + 1]); i++)
      for (PetscInt a = 0; a < dim; a++)
        e->load[k * dim + a] += w[(i - e->nodes[0]) * dim + a] * r[(i - e->nodes[0]) * dim + a];
  PetscCall(VecRestoreArrayRead(residual, &r));
  PetscCall(VecRestoreArrayRead(weight, &w));
  if (e->align) ElasticInertiaAddForce(&e->inertia, l, c->field.u, e->load);
  for (PetscInt i = 0; i < l->nnode * dim; i++) one[i] = body[i / dim] < 0 ? (1 - one[i]) * c->field.u[i] : 0;
  PetscCall(MatMult(e->P, free, weight));
  PetscCall(VecDot(residual, weight, &e->supplied));
  e->supplied = -e->supplied;
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, e->load, e->s->n * dim, MPIU_REAL, MPIU_SUM, c->comm));
  PetscCall(VecDestroy(&free));
  PetscCall(VecDestroy(&weight));
  PetscCall(VecDestroy(&residual));
  PetscCall(PetscFree(one));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* e->change [n][dim]: int c_t u_s - d(u_s) over the reference meshes */
static PetscErrorCode measure_change(Elastic *e, const FlowStep *step)
{
  const SolidsState *s   = e->s;
  const PetscInt     dim = s->dim;

  PetscFunctionBeginUser;
  for (PetscInt k = s->own[0]; k < s->own[1]; k++) {
    const SolidMesh *m = &s->group[s->group_of[k]].mesh;

    for (PetscInt a = 0; a < dim; a++) e->change[k * dim + a] = 0;
    for (PetscInt i = 0; i < m->ncell * m->nq * m->nb && !SolidIsMembrane(m); i++) {
      const PetscInt  cell = i / (m->nq * m->nb), q = i / m->nb % m->nq, j = i % m->nb;
      const PetscInt  at = dim * (s->first[k] + m->cell_node[cell * m->nb + j]);
      const PetscReal w  = m->weight[cell * m->nq + q] * m->phi[q * m->nb + j];

      for (PetscInt a = 0; a < dim; a++)
        e->change[k * dim + a] += w * (step->ct * e->u[at + a] - step->d0 * s->u[at + a] - step->d1 * s->u_old[at + a]);
    }
  }
  PetscCall(SolidsExchange(s, dim, e->change));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode solved(Couple c, void *data)
{
  Elastic *e = (Elastic *)data;

  PetscFunctionBeginUser;
  PetscCall(ElasticTensionsTake(e, c));
  PetscCall(ElasticTakeVelocity(e, c, c->field.u));
  PetscCall(ElasticFindEnd(e, c));
  PetscCall(measure_force(e, c));
  PetscCall(measure_change(e, c->step));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode balance(Couple c, void *data, const FlowDiagnostics *d, CoupleBalance *b)
{
  const Elastic *e = (const Elastic *)data;

  PetscFunctionBeginUser;
  (void)d;
  for (PetscInt i = 0; i < e->s->n * c->loc->dim; i++) {
    b->others[i % c->loc->dim] += e->load[i];
    b->residual[i % c->loc->dim] -= e->load[i];
    b->size += PetscAbsReal(e->load[i]) + c->par->density * PetscAbsReal(e->change[i]);
  }
  PetscCall(ElasticAddPull(e, &b->size));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode add_energy(Couple c, void *data, CouplePower *w)
{
  PetscFunctionBeginUser;
  PetscCall(ElasticAddEnergy((const Elastic *)data, c, w));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode add_losses(Couple c, void *data, CoupleLosses *w)
{
  PetscFunctionBeginUser;
  PetscCall(ElasticAddLosses((const Elastic *)data, c, w));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode limit(Couple c, void *data, PetscReal *dt)
{
  PetscFunctionBeginUser;
  PetscCall(ElasticLimitStep((const Elastic *)data, c, dt));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode overstep(Couple c, void *data, PetscReal *ratio)
{
  PetscFunctionBeginUser;
  PetscCall(ElasticOverstep((const Elastic *)data, c, ratio));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Once, with or without -sim_adapt: the first step that is much too long */
static PetscErrorCode remark_far(Elastic *e, Couple c)
{
  PetscReal ratio = 0;

  PetscFunctionBeginUser;
  if (e->once.told) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(ElasticOverstep(e, c, &ratio));
  e->once.told = (PetscBool)(ratio > FAR);
  if (e->once.told)
    PetscCall(
      LogRemark("an elastic particle moves, or is strained, %.2g times as far as a step stands (a cell, a half) in the step to t = %g: lower -sim_dt "
                "(%g), at the start at least",
                (double)ratio, (double)c->step->time, (double)c->step->dt));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode advance(Couple c, void *data)
{
  Elastic *e = (Elastic *)data;

  PetscFunctionBeginUser;
  PetscCall(remark_far(e, c));
  PetscCall(ElasticCheckStep(e, c));
  PetscCall(ElasticRemarkLineUp(e, c));
  e->lineup.immersed += e->align && e->labels.immersed;
  PetscCall(SolidsAccept(e->solids, c->step->dt, e->end, e->u, e->tensions.tension));
  if (e->ale) PetscCall(ElasticAleAccept(e->ale));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode visit(Couple c, void *data, State state)
{
  Elastic *e = (Elastic *)data;

  PetscFunctionBeginUser;
  if (!e->aligned) PetscFunctionReturn(PETSC_SUCCESS);
  if (StateIsLoading(state) && e->rebase && !e->align) PetscCall(begin_on_lined_up(e, c));
  if (!e->align) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(ElasticAlignVisitState(e->align, state));
  if (e->carried.shift) PetscCall(StateNodes(state, "elastic_shift", c->loc->dim, e->carried.shift));
  if (StateIsLoading(state)) {
    PetscCall(ElasticAlignGetLabels(e->align, &e->labels));
    PetscCall(set_properties(e, c));
  }
  if (StateIsLoading(state) && e->anchored && !e->ale) PetscCall(create_ale(e, c));
  if (e->ale) PetscCall(ElasticAleVisitState(e->ale, state));
  PetscCall(CoupleNeedsSolver(c));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode view(Couple c, void *data, PetscViewer viewer)
{
  PetscFunctionBeginUser;
  (void)c;
  PetscCall(SolidsView(((Elastic *)data)->solids, viewer));
  PetscCall(PetscViewerASCIIPrintf(viewer, "  %s\n",
                                   ((Elastic *)data)->aligned ? "the mesh is lined up with them in every step"
                                                              : "immersed: the mesh stays as it is"));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static const CoupleParticipant ELASTIC = {.name          = "elastic",
                                          .others        = PETSC_TRUE,
                                          .begin         = predict,
                                          .prepare       = prepare,
                                          .rows          = assemble,
                                          .solved        = solved,
                                          .balance       = balance,
                                          .energy        = add_energy,
                                          .losses        = add_losses,
                                          .limit         = limit,
                                          .overstep      = overstep,
                                          .advance       = advance,
                                          .connect       = ElasticTensionsConnect,
                                          .before_remesh = keep_of_mesh,
                                          .discard       = discard,
                                          .after_remesh  = make_on_mesh,
                                          .visit         = visit,
                                          .view          = view,
                                          .destroy       = destroy};

/* Solvers that the terms of a solid are known to */
static PetscErrorCode check_solver(Couple c, const SolidsState *s)
{
  char kind[32];

  PetscFunctionBeginUser;
  PetscCall(OptPeek("-flow_solver", kind, sizeof(kind)));
  PetscCheck(strcmp(kind, "fast"), c->comm, PETSC_ERR_SUP,
             "-flow_solver fast leaves too much of the force of an elastic solid: use -flow_solver balanced, accurate or direct");
  for (PetscInt g = 0; g < s->ngroups; g++)
    PetscCheck(!s->group[g].compressible || !strcmp(kind, "direct"), c->comm, PETSC_ERR_SUP,
               "-particle_%s_poisson below 0.5: a compressible solid in a flow needs -flow_solver direct",
               s->group[g].name);
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* -couple_method aligned, of solids alone, beside rigid bodies that move (one fit to both) or next to such as stand
   still (the mesh is lined up with these once). A mesh that has been given another form as a whole has no cells to be
   made anew. */
static PetscErrorCode choose_method(Elastic *e, Couple c)
{
  const BoundaryMethod *method = c->method.table;
  const char           *why;
  PetscBool             tracks = PETSC_FALSE, still;

  PetscFunctionBeginUser;
  if (!c->s->nall) PetscCall(BoundaryMethodChoose(&method));
  e->aligned = method->moves_nodes;
  if (!e->aligned) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(OptPeekBool("-mesh_track", &tracks));
  PetscCall(CoupleCanAlignSolids(e->s->dim, c->bodies, e->solids, tracks, &why));
  PetscCheck(!why, c->comm, PETSC_ERR_SUP, "%s", why);
  PetscCall(BodiesAreStill(c->bodies, &still));
  e->rebase   = (PetscBool)(c->s->nall > 0 && still);
  e->beside   = (PetscBool)(c->s->nall > 0 && !still);
  e->anchored = (PetscBool)(e->s->dim == 2 && !SolidsHave(e->s, PETSC_TRUE) && !e->beside);
  for (PetscInt g = 0; g < e->s->ngroups; g++) e->anchored = (PetscBool)(e->anchored && e->s->group[g].nclamped > 0);
  PetscCall(OptBool("-couple_anchored", &e->anchored));
  PetscCheck(!e->anchored || e->s->dim == 2, c->comm, PETSC_ERR_SUP,
             "-couple_anchored true: the mesh goes along with elastic particles that are held in the plane alone; in space it is lined up with them in "
             "every step: remove it");
  PetscCheck(!e->anchored || !e->beside, c->comm, PETSC_ERR_SUP,
             "-couple_anchored true: beside rigid bodies that move the mesh is lined up with elastic particles in every step: remove it");
  PetscCheck(!tracks || !e->anchored, c->comm, PETSC_ERR_SUP,
             "-mesh_track true: the mesh goes along with elastic particles that are held, and its fine cells with it: remove -mesh_track");
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Where solids have a corner on the surface of a rigid body a vertex of the mesh is to lie: it is lined up with the
   body first */
static PetscErrorCode give_corners(Elastic *e, Couple c)
{
  const PetscInt *node;
  PetscInt        n;

  PetscFunctionBeginUser;
  if (!e->rebase || !c->method.table->points) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(ElasticSurfacesGetCorners(e->surfaces, &n, &node));
  PetscCall(PetscMalloc1(2 * n, &e->corner));
  for (PetscInt i = 0; i < 2 * n; i++) e->corner[i] = e->s->X[2 * node[i / 2] + i % 2];
  PetscCall((*c->method.table->points)(c->method.data, n, e->corner));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode CoupleSetSolids(Couple c, Solids solids)
{
  Elastic *e;
  PetscInt n;

  PetscFunctionBeginUser;
  PetscCall(PetscNew(&e));
  e->solids = solids;
  PetscCall(SolidsGetState(solids, &e->s));
  PetscCall(check_solver(c, e->s));
  PetscCall(choose_method(e, c));
  PetscCall(ElasticAddPhases(e, c));
  n = e->s->nnode * e->s->dim;
  PetscCall(PetscCalloc7(n, &e->x, n, &e->a, n, &e->u, n, &e->end, e->s->n * e->s->dim, &e->load, e->s->n * e->s->dim,
                         &e->change, e->s->n, &e->kept));
  c->elastic = e;
  PetscCall(ElasticTensionsCreate(e));
  PetscCall(create_rows(e, c->comm));
  PetscCall(ElasticSurfacesCreate(e->s, &e->surfaces));
  PetscCall(give_corners(e, c));
  PetscCall(CoupleAddParticipant(c, &ELASTIC, e));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscReal CoupleGetVolumeKept(Couple c, PetscInt k)
{
  return c->elastic ? c->elastic->kept[k] : 0;
}

PetscInt CoupleCountImmersed(Couple c)
{
  return c->elastic && c->elastic->aligned ? c->elastic->lineup.immersed : -1;
}

PetscErrorCode CoupleGetSolidForce(Couple c, PetscInt k, PetscReal force[3])
{
  const Elastic   *e = c->elastic;
  const SolidMesh *m;

  PetscFunctionBeginUser;
  for (PetscInt a = 0; a < 3; a++) force[a] = 0;
  if (!e) PetscFunctionReturn(PETSC_SUCCESS);
  m = &e->s->group[e->s->group_of[k]].mesh;
  for (PetscInt a = 0; a < c->loc->dim; a++) /* what a membrane encloses is the flow's, lined up or not */
    force[a] = (ElasticIsLined(e, k) && !SolidIsMembrane(m) ? c->par->density * c->par->gravity[a] * m->volume
                                                            : c->par->density * e->change[k * c->loc->dim + a]) -
               e->load[k * c->loc->dim + a];
  PetscFunctionReturn(PETSC_SUCCESS);
}
