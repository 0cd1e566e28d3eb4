/* ScalarPhases: see scalarphases.h. */
#include "compat.h"
#include "impl.h"
#include "scalarbooks.h"
#include "scalarmaterial.h"
#include "scalarphases.h"
#include "scalarstart.h"

struct _p_ScalarPhases {
  Couple           c;
  Scalars          scalars;
  PetscInt         n, nphase;
  ScalarPhase     *phase;    /* [nphase] */
  ScalarMaterial  *material; /* [nphase][n] */
  ScalarBooks      books;
  PetscInt        *cell;   /* [ncell_all] NULL: not on this mesh yet */
  PetscReal       *part;   /* [ncell_all] */
  const PetscReal *V;      /* [nnode_all][dim] NULL: that of the flow's mesh */
  PetscInt        *fluid;  /* [ncell_all] where the options' sources act */
  PetscReal       *weight; /* [ncell_all] */
  PetscReal       *along;  /* [nnode_all] */
  PetscReal       *still;  /* [nnode_all][dim] velocity of nodes where the flow's have none */
  struct Numbers {
    PetscReal *capacity, *conductivity, *source, *decay; /* [ncell_all] */
  } * data;                                              /* [n] */
};

static const ScalarMaterial *get_material(const struct _p_ScalarPhases *s, PetscInt e, PetscInt i)
{
  return s->cell[e] < 0 ? NULL : s->material + s->cell[e] * s->n + i;
}

PetscErrorCode ScalarPhasesCreate(Couple c, Scalars scalars, PetscInt n, const ScalarPhase phase[],
                                  ScalarPhases *phases)
{
  ScalarPhases s;

  PetscFunctionBeginUser;
  PetscCall(PetscNew(&s));
  s->c       = c;
  s->scalars = scalars;
  s->n       = ScalarsCount(scalars);
  s->nphase  = n;
  PetscCall(PetscMalloc1(n, &s->phase));
  if (n) PetscCall(PetscArraycpy(s->phase, phase, n));
  PetscCall(PetscCalloc1(n * s->n, &s->material));
  PetscCall(PetscCalloc1(s->n, &s->data));
  PetscCall(ScalarBooksCreate(c, scalars, &s->books));
  for (PetscInt e = 0; e < n * s->n; e++) {
    const ScalarParameters *par;

    PetscCall(ScalarsGetParameters(scalars, e % s->n, &par));
    PetscCall(ScalarMaterialReadPhase(c, phase[e / s->n].name, par, s->material + e));
  }
  *phases = s;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ScalarPhasesDiscard(ScalarPhases s)
{
  PetscFunctionBeginUser;
  if (!s) PetscFunctionReturn(PETSC_SUCCESS);
  for (PetscInt i = 0; i < s->n; i++)
    PetscCall(PetscFree4(s->data[i].capacity, s->data[i].conductivity, s->data[i].source, s->data[i].decay));
  PetscCall(PetscFree6(s->cell, s->part, s->fluid, s->weight, s->along, s->still));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ScalarPhasesDestroy(ScalarPhases *phases)
{
  ScalarPhases s = *phases;

  PetscFunctionBeginUser;
  if (!s) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(ScalarPhasesDiscard(s));
  PetscCall(ScalarBooksDestroy(&s->books));
  PetscCall(PetscFree(s->phase));
  PetscCall(PetscFree(s->material));
  PetscCall(PetscFree(s->data));
  PetscCall(PetscFree(*phases));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ScalarPhasesSetCells(ScalarPhases s, const PetscInt cell[], const PetscReal part[], const PetscReal V[])
{
  const PetscInt n = s->c->loc->ncell_all, nn = s->c->loc->nnode_all;

  PetscFunctionBeginUser;
  if (!s->cell) {
    PetscCall(PetscCalloc6(n, &s->cell, n, &s->part, n, &s->fluid, n, &s->weight, nn, &s->along, nn * s->c->loc->dim,
                           &s->still));
    for (PetscInt i = 0; i < s->n; i++) {
      struct Numbers *d = s->data + i;

      PetscCall(PetscMalloc4(n, &d->capacity, n, &d->conductivity, n, &d->source, n, &d->decay));
    }
  }
  s->V = V;
  PetscCall(PetscArraycpy(s->cell, cell, n));
  for (PetscInt e = 0; e < n; e++) s->part[e] = cell[e] < 0 ? 0 : part ? part[e] : 1;
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscReal mean_conductivity(const ScalarMaterial *m, const ScalarParameters *par, PetscReal part)
{
  if (m->conductivity > par->conductivity && par->conductivity > 0)
    return 1 / (part / m->conductivity + (1 - part) / par->conductivity);
  return part * m->conductivity + (1 - part) * par->conductivity;
}

PetscErrorCode ScalarPhasesUpdate(ScalarPhases s)
{
  PetscFunctionBeginUser;
  for (PetscInt e = 0; e < s->c->loc->ncell_all; e++)
    s->fluid[e] = s->part[e] < 0.5 ? SCALAR_COUNTS_ALL : SCALAR_COUNTS_NOTHING;
  for (PetscInt i = 0; i < s->n; i++) {
    struct Numbers         *d = s->data + i;
    const ScalarParameters *par;

    PetscCall(ScalarsGetParameters(s->scalars, i, &par));
    for (PetscInt e = 0; e < s->c->loc->ncell_all; e++) {
      const ScalarMaterial *m    = get_material(s, e, i);
      const PetscReal       part = s->part[e];

      d->capacity[e]     = m ? part * m->capacity + (1 - part) * par->capacity : par->capacity;
      d->conductivity[e] = m ? mean_conductivity(m, par, part) : par->conductivity;
      d->source[e]       = m ? part * m->source : 0;
      d->decay[e]        = m ? part * m->decay * m->capacity / d->capacity[e] : 0;
    }
    PetscCall(ScalarsSetCells(s->scalars, i,
                              &(ScalarCells){.capacity     = d->capacity,
                                             .conductivity = d->conductivity,
                                             .source       = d->source,
                                             .decay        = d->decay,
                                             .fluid        = s->fluid}));
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscBool ScalarPhasesAreAlike(ScalarPhases s, PetscInt a, PetscInt b)
{
  PetscBool alike = PETSC_TRUE;

  for (PetscInt i = 0; i < s->n; i++) {
    const ScalarMaterial *m = s->material + a * s->n + i, *k = s->material + b * s->n + i;

    alike = (PetscBool)(alike && m->conductivity == k->conductivity && m->capacity == k->capacity &&
                        m->source == k->source && m->decay == k->decay && m->expansion == k->expansion &&
                        m->reference == k->reference);
  }
  return alike;
}

PetscErrorCode ScalarPhasesGetVelocity(ScalarPhases s, const PetscReal *V[])
{
  PetscFunctionBeginUser;
  *V = s->V;
  if (!s->V) PetscCall(FlowGetMeshVelocity(s->c->flow, V));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* What the books need; what appears goes to cells of moving nodes and of phases, or to all */
static PetscErrorCode get_motion(ScalarPhases s, ScalarMotion *m)
{
  const MeshLocal *l = s->c->loc;

  PetscFunctionBeginUser;
  *m = (ScalarMotion){.along = s->along};
  PetscCall(ScalarPhasesGetVelocity(s, &m->V));
  if (!m->V) m->V = s->still;
  for (PetscInt i = 0; i < l->nnode_all; i++) {
    s->along[i] = s->nphase ? 0 : 1;
    for (PetscInt a = 0; a < l->dim; a++) s->along[i] += PetscAbsReal(m->V[i * l->dim + a]);
  }
  for (PetscInt e = 0; e < l->ncell_all * l->nb; e++) s->along[l->cell_node[e]] += s->part[e / l->nb];
  PetscCall(MeshSyncNodes(s->c->mesh, 1, s->along));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ScalarPhasesStart(ScalarPhases s)
{
  const PetscInt         n = s->c->loc->ncell_all;
  const ScalarMaterial **material;
  ScalarMotion           m;

  PetscFunctionBeginUser;
  PetscCall(get_motion(s, &m));
  PetscCall(PetscMalloc1(n, &material));
  for (PetscInt i = 0; i < s->n; i++) {
    PetscReal *T[3];

    for (PetscInt e = 0; e < n; e++) material[e] = get_material(s, e, i);
    PetscCall(ScalarsStartAt(s->scalars, i, s->c->loc->x));
    PetscCall(ScalarsGetFields(s->scalars, i, &T[0], &T[1]));
    PetscCall(ScalarsGetSolution(s->scalars, i, &T[2]));
    PetscCall(ScalarStartInside(s->c, s->scalars, i, material, s->part, T[0]));
    for (PetscInt t = 1; t < 3; t++) PetscCall(PetscArraycpy(T[t], T[0], s->c->loc->nnode_all));
    PetscCall(ScalarBooksBegin(s->books, &m, i));
  }
  PetscCall(PetscFree(material));
  PetscFunctionReturn(PETSC_SUCCESS);
}

const PetscReal *ScalarPhasesWeight(ScalarPhases s, PetscInt i)
{
  const ScalarParameters *par;

  (void)ScalarsGetParameters(s->scalars, i, &par);
  for (PetscInt e = 0; e < s->c->loc->ncell_all; e++) {
    const ScalarMaterial *m = get_material(s, e, i);

    s->weight[e] = 1 - s->part[e];
    if (m && par->expansion != 0)
      s->weight[e] += s->part[e] * s->phase[s->cell[e]].density * m->expansion / (s->c->par->density * par->expansion);
  }
  return s->weight;
}

/* Of cells that stand still while surfaces pass: what the flow carries into cells of another capacity, and no jump of
   theirs makes. Cells that go along are passed by none. */
static PetscErrorCode measure_passing(ScalarPhases s, const ScalarMotion *m, PetscInt i, PetscReal *passing)
{
  const MeshLocal *l = s->c->loc;
  ScalarExcess     e;

  PetscFunctionBeginUser;
  *passing = 0;
  for (PetscInt c = 0; c < l->ncell; c++) {
    PetscBool still = (PetscBool)(s->part[c] > 0);

    for (PetscInt j = 0; j < l->nb * l->dim && still; j++)
      still = (PetscBool)(m->V[l->cell_node[c * l->nb + j / l->dim] * l->dim + j % l->dim] == 0);
    if (!still) continue;
    PetscCall(ScalarsMeasureExcess(s->scalars, i, c, &e));
    *passing += e.convected;
  }
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, passing, 1, MPIU_REAL, MPIU_SUM, s->c->comm));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ScalarPhasesGiveBack(ScalarPhases s, PetscInt i)
{
  ScalarMotion m;
  PetscReal    passing;

  PetscFunctionBeginUser;
  PetscCall(get_motion(s, &m));
  PetscCall(measure_passing(s, &m, i, &passing));
  PetscCall(ScalarBooksGiveBack(s->books, &m, i, passing, s->data[i].source));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ScalarPhasesCorrect(ScalarPhases s, PetscInt i, PetscBool *again)
{
  ScalarMotion m;
  PetscReal    passing;

  PetscFunctionBeginUser;
  PetscCall(get_motion(s, &m));
  PetscCall(measure_passing(s, &m, i, &passing));
  PetscCall(ScalarBooksCorrect(s->books, &m, i, passing, s->data[i].source, again));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ScalarPhasesMeasure(ScalarPhases s, PetscReal covered[])
{
  ScalarMotion m;
  PetscReal    passing;

  PetscFunctionBeginUser;
  PetscCall(get_motion(s, &m));
  for (PetscInt i = 0; i < s->n; i++) {
    PetscCall(measure_passing(s, &m, i, &passing));
    PetscCall(ScalarBooksMeasure(s->books, &m, i, passing, covered + i));
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ScalarPhasesAccept(ScalarPhases s)
{
  PetscFunctionBeginUser;
  PetscCall(ScalarBooksAccept(s->books));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ScalarPhasesVisit(ScalarPhases s, State state)
{
  PetscFunctionBeginUser;
  PetscCall(ScalarBooksVisit(s->books, "phase_books", state));
  PetscFunctionReturn(PETSC_SUCCESS);
}
