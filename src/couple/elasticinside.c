/* ElasticInside: see elasticinside.h. */
#include "compat.h"
#include "cutcells.h"
#include "elasticinside.h"
#include "fem/element.h"

#define SAMPLES 4 /* sub-cells along an axis of a cut cell */

/* The surface in question, and what is known of the nodes: signed distance d [nnode_all] where known */
struct _p_ElasticInside {
  const MeshLocal     *l;
  const AlignSurfaces *table;
  const PetscBool     *lined;
  const PetscInt      *cell_solid;
  PetscInt             samples;
  PetscReal            phi[SAMPLES * SAMPLES * SAMPLES * ELEMENT_MAX_NB]; /* basis at the middles of sub-cells */
  PetscInt             k, n, *node;                                       /* n nodes whose distance is asked for next */
  PetscReal           *x, *value, *d, *inside, *radius, *size;            /* size: radius of every cell */
  PetscBool           *known;
};

/* Place of a node about the centre of the surface, its nearest image */
static void find_place(const struct _p_ElasticInside *s, PetscInt node, PetscReal r[3])
{
  for (PetscInt a = 0; a < s->l->dim; a++)
    r[a] = MeshNearest(s->l, a, s->l->x[s->l->dim * node + a] - s->table->centre[s->k][a]);
}

static void ask(ElasticInside s, PetscInt node)
{
  const PetscInt dim = s->l->dim;

  if (s->known[node]) return;
  s->known[node] = PETSC_TRUE;
  find_place(s, node, s->x + dim * s->n);
  for (PetscInt a = 0; a < dim; a++) s->x[dim * s->n + a] += s->table->centre[s->k][a];
  s->node[s->n++] = node;
}

static PetscErrorCode answer(ElasticInside s)
{
  PetscFunctionBeginUser;
  PetscCall((*s->table->distance)(s->table->ctx, s->k, s->table->centre[s->k], s->n, s->x, s->value));
  for (PetscInt i = 0; i < s->n; i++) s->d[s->node[i]] = s->value[i];
  s->n = 0;
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscBool is_near(const struct _p_ElasticInside *s, PetscInt node, PetscReal reach)
{
  PetscReal r[3], r2 = 0;

  find_place(s, node, r);
  for (PetscInt a = 0; a < s->l->dim; a++) r2 += r[a] * r[a];
  return (PetscBool)(r2 < PetscSqr(s->table->radius[s->k] + reach));
}

/* s->inside of surface k, by its distance */
static PetscErrorCode measure(ElasticInside s)
{
  const MeshLocal *l      = s->l;
  const PetscInt   middle = l->nb / 2;
  PetscReal       *radius = s->radius, *inside = s->inside;

  PetscFunctionBeginUser;
  PetscCall(PetscArrayzero(s->known, l->nnode_all));
  for (PetscInt c = 0; c < l->ncell_all; c++) {
    radius[c] = s->size[c];
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
    for (PetscInt q = 0; q < s->samples; q++) {
      PetscReal d = 0;

      for (PetscInt j = 0; j < l->nb; j++) d += s->phi[q * l->nb + j] * s->d[l->cell_node[c * l->nb + j]];
      inside[c] += PetscMin(1, PetscMax(0, 0.5 - d / width)) / (PetscReal)s->samples;
    }
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

static void set_samples(ElasticInside s)
{
  for (PetscInt q = 0; q < s->samples; q++) {
    PetscReal xi[3], dphi[3 * ELEMENT_MAX_NB];

    for (PetscInt a = 0, i = q; a < s->l->dim; a++, i /= SAMPLES)
      xi[a] = (2 * (i % SAMPLES) + 1) / (PetscReal)SAMPLES - 1;
    ElementBasis(s->l->dim, xi, s->phi + q * s->l->nb, dphi);
  }
}

PetscErrorCode ElasticInsideCreate(Mesh mesh, ElasticSurfaces surfaces, const PetscBool lined[],
                                   const PetscInt cell_solid[], ElasticInside *inside)
{
  const MeshLocal *l;
  ElasticInside    s;

  PetscFunctionBeginUser;
  PetscCall(PetscNew(&s));
  PetscCall(MeshGetLocal(mesh, &l));
  s->l          = l;
  s->table      = ElasticSurfacesGet(surfaces);
  s->lined      = lined;
  s->cell_solid = cell_solid;
  s->samples    = l->dim == 2 ? SAMPLES * SAMPLES : SAMPLES * SAMPLES * SAMPLES;
  set_samples(s);
  PetscCall(PetscMalloc5(l->nnode_all, &s->node, l->dim * l->nnode_all, &s->x, l->nnode_all, &s->value, l->nnode_all,
                         &s->d, l->nnode_all, &s->known));
  PetscCall(PetscMalloc3(l->ncell_all, &s->inside, l->ncell_all, &s->radius, l->ncell_all, &s->size));
  for (PetscInt c = 0; c < l->ncell_all; c++) PetscCall(CutCellRadius(mesh, c, &s->size[c]));
  *inside = s;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ElasticInsideDestroy(ElasticInside *inside)
{
  ElasticInside s = *inside;

  PetscFunctionBeginUser;
  PetscCall(PetscFree5(s->node, s->x, s->value, s->d, s->known));
  PetscCall(PetscFree3(s->inside, s->radius, s->size));
  PetscCall(PetscFree(*inside));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ElasticInsideFind(ElasticInside s, PetscInt k, const PetscReal *inside[])
{
  PetscFunctionBeginUser;
  s->k    = k;
  *inside = s->inside;
  if (!s->lined || !s->lined[k]) PetscCall(measure(s));
  else
    for (PetscInt c = 0; c < s->l->ncell_all; c++) s->inside[c] = s->cell_solid[c] == k;
  PetscFunctionReturn(PETSC_SUCCESS);
}
