/* Bodies, sub-domains: see subdomains.h. */
#include "compat.h"
#include "impl.h"
#include "subdomains.h"
#include "base/domain.h"
#include "base/rowtype.h"
#include "bodies/local.h"

#define BINS    1024 /* along an axis, in which bodies are counted for the cuts */
#define UNEVEN  1.1  /* own bodies of the fullest rank by the mean, beyond which the cuts move */
#define AT_ONCE 64   /* bodies; fewer are not worth the cuts */

/* Of all ways to cut the box the one with the least surface */
static void choose_subdomains(BodySubdomains *p)
{
  PetscReal best = PETSC_MAX_REAL;

  for (PetscInt i = 1; i <= p->size; i++)
    for (PetscInt j = 1; j <= p->size / i; j++) {
      const PetscInt n[3] = {i, j, p->size / i / j};
      PetscReal      sum  = 0;

      if (i * j * n[2] != p->size || (p->dim == 2 && n[2] > 1)) continue;
      for (PetscInt a = 0; a < p->dim; a++) sum += n[a] / (p->upper[a] - p->lower[a]);
      if (sum >= best) continue;
      best = sum;
      for (PetscInt a = 0; a < 3; a++) p->n[a] = n[a];
    }
}

PetscErrorCode BodiesSetBoxes(Bodies b, const BodyBoxes *boxes)
{
  BodySubdomains *p = b->subdomains;

  PetscFunctionBeginUser;
  PetscCall(RankBoxesDestroy(&p->regions));
  PetscCall(CurveDestroy(&p->curve));
  p->curve  = boxes->curve;
  p->beyond = boxes->beyond;
  PetscCallMPI(MPI_Allreduce(MPI_IN_PLACE, &p->beyond, 1, MPIU_REAL, MPIU_MAX, p->comm));
  PetscCall(RankBoxesCreate(p->comm, p->dim, p->lower, p->upper, p->period, boxes->n, boxes->box, &p->regions));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode BodiesLookFarther(Bodies b, PetscReal reach)
{
  PetscFunctionBeginUser;
  PetscCall(BodiesMax(b, 1, &reach));
  if (b->subdomains) b->subdomains->farther = reach;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode BodySubdomainsCreate(MPI_Comm comm, PetscInt dim, const PetscReal lower[3], const PetscReal upper[3],
                                    const PetscReal period[3], BodySubdomains **subdomains)
{
  BodySubdomains *p;

  PetscFunctionBeginUser;
  PetscCall(PetscNew(&p));
  PetscCall(PetscCommDuplicate(comm, &p->comm, &p->tag));
  p->dim = dim;
  PetscCallMPI(MPI_Comm_rank(comm, &p->rank));
  PetscCallMPI(MPI_Comm_size(comm, &p->size));
  for (PetscInt a = 0; a < dim; a++) {
    p->lower[a]  = lower[a];
    p->upper[a]  = upper[a];
    p->period[a] = period[a];
  }
  for (int i = 0; i < 2; i++) PetscCall(RowTypeCreate(3 + i, &p->unit[i]));
  choose_subdomains(p);
  p->at[0] = p->rank % p->n[0];
  p->at[1] = p->rank / p->n[0] % p->n[1];
  p->at[2] = p->rank / p->n[0] / p->n[1];
  for (PetscInt a = 0; a < dim; a++) {
    PetscCall(PetscMalloc1(p->n[a] + 1, &p->cut[a]));
    for (PetscInt i = 0; i <= p->n[a]; i++) p->cut[a][i] = lower[a] + (upper[a] - lower[a]) * i / p->n[a];
  }
  *subdomains = p;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode BodySubdomainsDestroy(BodySubdomains **subdomains)
{
  PetscFunctionBeginUser;
  if (!*subdomains) PetscFunctionReturn(PETSC_SUCCESS);
  for (PetscInt a = 0; a < 3; a++) PetscCall(PetscFree((*subdomains)->cut[a]));
  PetscCall(RankBoxesDestroy(&(*subdomains)->regions));
  PetscCall(CurveDestroy(&(*subdomains)->curve));
  PetscCall(PetscSFDestroy(&(*subdomains)->ghosts));
  for (int i = 0; i < 2; i++) PetscCall(RowTypeDestroy(&(*subdomains)->unit[i]));
  PetscCall(PetscCommDestroy(&(*subdomains)->comm));
  PetscCall(PetscFree(*subdomains));
  PetscFunctionReturn(PETSC_SUCCESS);
}

void BodySubdomainsInside(const BodySubdomains *p, const PetscReal x[3], PetscReal y[3])
{
  for (PetscInt a = 0; a < p->dim; a++)
    y[a] = PetscMin(PetscMax(DomainWrap(p->period[a], x[a], p->lower[a]), p->lower[a]), p->upper[a]);
}

PetscMPIInt BodySubdomainsRank(const BodySubdomains *p, const PetscReal x[3])
{
  PetscInt  at[3] = {0, 0, 0};
  PetscReal y[3];

  BodySubdomainsInside(p, x, y);
  if (p->curve) return CurveOwner(p->curve, y);
  if (p->regions) return RankBoxesOwner(p->regions, y);
  for (PetscInt a = 0; a < p->dim; a++)
    for (PetscInt low = 0, high = p->n[a]; high - low > 1; at[a] = low) {
      const PetscInt middle = (low + high) / 2;

      if (y[a] < p->cut[a][middle]) high = middle;
      else low = middle;
    }
  return (PetscMPIInt)((at[2] * p->n[1] + at[1]) * p->n[0] + at[0]);
}

PetscBool BodySubdomainsOwn(const BodySubdomains *p, const PetscReal x[3])
{
  return (PetscBool)(!p || BodySubdomainsRank(p, x) == p->rank);
}

PetscBool BodySubdomainsNear(const BodySubdomains *p, PetscInt a, PetscInt i, PetscReal y, PetscReal reach)
{
  for (PetscInt image = p->period[a] > 0 ? -1 : 0; image <= (p->period[a] > 0 ? 1 : 0); image++) {
    const PetscReal x = y + image * p->period[a];

    if (x > p->cut[a][i] - reach && x < p->cut[a][i + 1] + reach) return PETSC_TRUE;
  }
  return PETSC_FALSE;
}

PetscBool BodySubdomainsDeep(const BodySubdomains *p, const PetscReal y[3], PetscReal reach)
{
  for (PetscInt a = 0; a < p->dim; a++)
    if (p->n[a] > 1 && (y[a] <= p->cut[a][p->at[a]] + reach || y[a] >= p->cut[a][p->at[a] + 1] - reach))
      return PETSC_FALSE;
  return PETSC_TRUE;
}

PetscErrorCode BodySubdomainsBalance(Bodies b)
{
  BodySubdomains   *p            = b->subdomains;
  const BodyArrays *s            = &b->state;
  PetscInt64        bin[3][BINS] = {{0}}, max[2] = {0, 0}, sum = 0;

  PetscFunctionBeginUser;
  if (p->regions) PetscFunctionReturn(PETSC_SUCCESS);
  for (PetscInt k = 0; k < s->n; k++) {
    PetscReal y[3];

    if (!s->own[k]) continue;
    max[0]++;
    BodySubdomainsInside(p, s->x[k], y);
    for (PetscInt a = 0; a < p->dim; a++)
      bin[a][PetscMin(BINS - 1, (PetscInt)(BINS * (y[a] - p->lower[a]) / (p->upper[a] - p->lower[a])))]++;
  }
  PetscCallMPI(MPI_Allreduce(MPI_IN_PLACE, max, 1, MPIU_INT64, MPI_MAX, p->comm));
  if (s->nall < AT_ONCE * p->size || max[0] * p->size < UNEVEN * s->nall) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCallMPI(MPI_Allreduce(MPI_IN_PLACE, bin, 3 * BINS, MPIU_INT64, MPI_SUM, p->comm));
  for (PetscInt a = 0; a < p->dim; a++, sum = 0)
    for (PetscInt j = 0, i = 1; j < BINS && i < p->n[a]; sum += bin[a][j++])
      for (; i < p->n[a] && (sum + bin[a][j]) * p->n[a] >= (PetscInt64)i * s->nall; i++) {
        const PetscReal fraction = ((PetscReal)i * s->nall / p->n[a] - sum) / PetscMax(1, bin[a][j]);

        p->cut[a][i] = p->lower[a] + (p->upper[a] - p->lower[a]) * (j + fraction) / BINS;
      }
  PetscFunctionReturn(PETSC_SUCCESS);
}
