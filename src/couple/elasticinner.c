/* ElasticInner: see elasticinner.h. */
#include "compat.h"
#include "cutcells.h"
#include "elasticinner.h"
#include "fem/element.h"

#define SAMPLES 4 /* sub-cells along an axis of a cut cell */

/* One membrane, and what is known of the nodes: signed distance d [nnode_all] where known */
typedef struct {
  Mesh                 mesh;
  const MeshLocal     *l;
  const AlignSurfaces *table;
  PetscInt             k, n, *node; /* n nodes whose distance is asked for next */
  PetscReal           *x, *value, *d;
  PetscBool           *known;
} Sides;

/* Place of a node about the centre of the surface, its nearest image */
static void find_place(const Sides *s, PetscInt node, PetscReal r[3])
{
  for (PetscInt a = 0; a < s->l->dim; a++)
    r[a] = MeshNearest(s->l, a, s->l->x[s->l->dim * node + a] - s->table->centre[s->k][a]);
}

static void ask(Sides *s, PetscInt node)
{
  const PetscInt dim = s->l->dim;

  if (s->known[node]) return;
  s->known[node] = PETSC_TRUE;
  find_place(s, node, s->x + dim * s->n);
  for (PetscInt a = 0; a < dim; a++) s->x[dim * s->n + a] += s->table->centre[s->k][a];
  s->node[s->n++] = node;
}

static PetscErrorCode answer(Sides *s)
{
  PetscFunctionBeginUser;
  PetscCall((*s->table->distance)(s->table->ctx, s->k, s->table->centre[s->k], s->n, s->x, s->value));
  for (PetscInt i = 0; i < s->n; i++) s->d[s->node[i]] = s->value[i];
  s->n = 0;
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscBool is_near(const Sides *s, PetscInt node, PetscReal reach)
{
  PetscReal r[3], r2 = 0;

  find_place(s, node, r);
  for (PetscInt a = 0; a < s->l->dim; a++) r2 += r[a] * r[a];
  return (PetscBool)(r2 < PetscSqr(s->table->radius[s->k] + reach));
}

/* inside [ncell_all] what part of every cell is within surface k; phi [samples][nb]: basis at the middles of
   sub-cells */
static PetscErrorCode measure_inside(Sides *s, PetscInt samples, const PetscReal phi[], PetscReal inside[])
{
  const MeshLocal *l      = s->l;
  const PetscInt   middle = l->nb / 2;
  PetscReal       *radius;

  PetscFunctionBeginUser;
  PetscCall(PetscMalloc1(l->ncell_all, &radius));
  PetscCall(PetscArrayzero(s->known, l->nnode_all));
  for (PetscInt c = 0; c < l->ncell_all; c++) {
    PetscCall(CutCellRadius(s->mesh, c, &radius[c]));
    if (!is_near(s, l->cell_node[c * l->nb + middle], radius[c])) radius[c] = -1;
    else ask(s, l->cell_node[c * l->nb + middle]);
  }
  PetscCall(answer(s));
  for (PetscInt c = 0; c < l->ncell_all; c++) {
    const PetscInt *node = l->cell_node + c * l->nb;

    inside[c] = radius[c] >= 0 && s->d[node[middle]] < 0;
    if (PetscAbsReal(s->d[node[middle]]) > radius[c]) radius[c] = -1;
    for (PetscInt j = 0; j < l->nb && radius[c] >= 0; j++) ask(s, node[j]);
  }
  PetscCall(answer(s));
  for (PetscInt c = 0; c < l->ncell_all; c++) {
    const PetscReal width = 2 * radius[c] / (1.1 * PetscSqrtReal((PetscReal)l->dim) * SAMPLES);

    if (radius[c] < 0) continue;
    inside[c] = 0;
    for (PetscInt q = 0; q < samples; q++) {
      PetscReal d = 0;

      for (PetscInt j = 0; j < l->nb; j++) d += phi[q * l->nb + j] * s->d[l->cell_node[c * l->nb + j]];
      inside[c] += PetscMin(1, PetscMax(0, 0.5 - d / width)) / (PetscReal)samples;
    }
  }
  PetscCall(PetscFree(radius));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* phi [samples][nb] */
static void set_samples(PetscInt dim, PetscInt samples, PetscInt nb, PetscReal phi[])
{
  for (PetscInt q = 0; q < samples; q++) {
    PetscReal xi[3], dphi[3 * ELEMENT_MAX_NB];

    for (PetscInt a = 0, i = q; a < dim; a++, i /= SAMPLES) xi[a] = (2 * (i % SAMPLES) + 1) / (PetscReal)SAMPLES - 1;
    ElementBasis(dim, xi, phi + q * nb, dphi);
  }
}

PetscErrorCode ElasticInnerFind(Mesh mesh, const SolidsState *solids, ElasticSurfaces surfaces, const PetscBool lined[],
                                const PetscInt cell_solid[], PetscReal outer, PetscReal viscosity[])
{
  Sides     s = {.mesh = mesh, .table = ElasticSurfacesGet(surfaces)};
  PetscInt  samples;
  PetscReal phi[SAMPLES * SAMPLES * SAMPLES * ELEMENT_MAX_NB], *inside;

  PetscFunctionBeginUser;
  PetscCall(MeshGetLocal(mesh, &s.l));
  samples = s.l->dim == 2 ? SAMPLES * SAMPLES : SAMPLES * SAMPLES * SAMPLES;
  set_samples(s.l->dim, samples, s.l->nb, phi);
  PetscCall(PetscMalloc6(s.l->nnode_all, &s.node, s.l->dim * s.l->nnode_all, &s.x, s.l->nnode_all, &s.value,
                         s.l->nnode_all, &s.d, s.l->nnode_all, &s.known, s.l->ncell_all, &inside));
  for (PetscInt c = 0; c < s.l->ncell_all; c++) viscosity[c] = outer;
  for (s.k = 0; s.k < solids->n; s.k++) {
    const PetscReal inner = solids->group[solids->group_of[s.k]].inner_viscosity;

    if (inner == 0) continue;
    if (!lined || !lined[s.k]) PetscCall(measure_inside(&s, samples, phi, inside));
    else
      for (PetscInt c = 0; c < s.l->ncell_all; c++) inside[c] = cell_solid[c] == s.k;
    for (PetscInt c = 0; c < s.l->ncell_all; c++) viscosity[c] += inside[c] * (inner - viscosity[c]);
  }
  PetscCall(PetscFree6(s.node, s.x, s.value, s.d, s.known, inside));
  PetscFunctionReturn(PETSC_SUCCESS);
}
