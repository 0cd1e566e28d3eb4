/* SolidPromise: see solidpromise.h. */
#include "compat.h"
#include "solidpromise.h"
#include "base/opt.h"
#include "couple/couple.h"

#define NEVER 1000 /* cells: a preset does not promise it */

/* How a particle is seen by the mesh */
enum {
  IMMERSED,
  LINED,
  HELD, /* lined up once, the mesh goes along */
  NFORMS
};

/* Cells across, by preset. Solids, lined up: disc in shear at capillary numbers .2, .05, .01 on two positions of the
   mesh, largest error of the deformation with 2, 3, 4, 6, 8 cells 2, .34, .22, .11, .11 %; the speed of one that
   falls .16, .17, .09, .04 % off; a beam that is held in a stream (FSI1), 2 cells, .3 %. Immersed one that falls is
   18, 25, 11, 8, 7 % slow with 2, 3, 4, 6, 8 cells. Membranes: in space, 5 cells, immersed .5 to 1.4 %, in the plane
   with 8 .5, lined up .1 %. Around another viscosity with 8, 16 cells: immersed 6, 3.4 %, lined up .7, .7 %
   (runs/studies/capsules). */
static const PetscReal SOLID[NFORMS][PROMISE_NPRESETS]    = {{NEVER, NEVER, NEVER}, {2, 3, 6}, {2, 2, 4}},
                       MEMBRANE[NFORMS][PROMISE_NPRESETS] = {{4, 8, NEVER}, {4, 8, 8}, {4, 8, 8}},
                       FILLED[NFORMS][PROMISE_NPRESETS]   = {{16, NEVER, NEVER}, {8, 8, NEVER}, {8, 8, NEVER}};
/* Cells of the layer of one that is held in a stream: FSI1 with .41 (one across), .82 cells 20, .7 %; FSI2, .37, .7 %
   of the stroke, 4 % of the amplitude of the drag; FSI3 with .26, .52 cells 8, 3 % (runs/studies/elastic/fsi.md). */
static const PetscReal STREAM[PROMISE_NPRESETS] = {0.35, 0.8, 2};

PetscErrorCode SolidPromiseCanAlign(const MeshLocal *l, Bodies bodies, Solids solids, PetscBool *can)
{
  SolidsState *s;
  PetscBool    tracks = PETSC_FALSE;
  const char  *why;

  PetscFunctionBeginUser;
  PetscCall(OptPeekBool("-mesh_track", &tracks));
  PetscCall(CoupleCanAlignSolids(l->dim, bodies, solids, tracks, &why));
  PetscCall(SolidsGetState(solids, &s));
  *can = (PetscBool)(!why && (l->dim == 2 || !SolidsHave(s, PETSC_TRUE)));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode SolidPromiseIsAlone(Bodies bodies, Solids solids, PetscBool *alone)
{
  SolidsState *s;

  PetscFunctionBeginUser;
  PetscCall(SolidsGetState(solids, &s));
  PetscCall(BodiesAreStill(bodies, alone));
  *alone = (PetscBool)(*alone && s->n == 1);
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Thickness about the centre; 0: that is not inside */
static PetscErrorCode measure_thickness(const SolidGroup *g, PetscReal *thick)
{
  ShapeMass mass;
  PetscReal d;

  PetscFunctionBeginUser;
  PetscCall(ShapeGetMass(g->shape, &mass));
  PetscCall(ShapeDistance(g->shape, 1, mass.centroid, &d));
  *thick = PetscMax(0, -2 * d);
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Of a membrane in space no more is promised lined up than immersed: three capillary numbers alone were compared, with
   5 cells (runs/studies/capsules) */
static PetscBool in_space(const SolidGroup *g)
{
  return (PetscBool)(g->membrane && g->mesh.dim == 3);
}

static const PetscReal *find_row(const SolidGroup *g, PetscBool aligned)
{
  const PetscInt form = !aligned || in_space(g) ? IMMERSED : g->nclamped ? HELD : LINED;

  return g->inner_viscosity > 0 ? FILLED[form] : g->membrane ? MEMBRANE[form] : SOLID[form];
}

/* Thickness of the boundary layer; infinite where there is none, or nothing is known */
static PetscErrorCode measure_layer(PetscInt dim, const SolidGroup *g, const Stream *stream, PetscReal thick,
                                    PetscReal *layer)
{
  PetscReal density, viscosity, speed = 0, size = thick;
  PetscBool convection = PETSC_TRUE;

  PetscFunctionBeginUser;
  PetscCall(StreamPeekFluid(&density, &viscosity));
  PetscCall(OptPeekBool("-flow_convection", &convection));
  if (g->nclamped) speed = stream->speed;
  else if (!g->membrane) {
    size = 2 * g->mesh.radius;
    PetscCall(PromiseFallSpeed(dim, size, g->density, &speed));
  }
  *layer = convection && speed > 0 ? PetscSqrtReal(size * viscosity / (density * speed)) : PETSC_MAX_REAL;
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* What keeps a preset from its promise; needed 0: nothing */
typedef struct {
  const SolidGroup *g;
  PetscReal         cells, needed;
  PetscBool         layer;
} Breach;

static PetscErrorCode find_breach(const MeshLocal *l, const SolidsState *s, const Stream *stream, PetscInt preset,
                                  PetscBool aligned, Breach *b)
{
  PetscFunctionBeginUser;
  *b = (Breach){.needed = 0};
  for (PetscInt i = 0; i < s->ngroups && b->needed == 0; i++) {
    const SolidGroup *g      = s->group + i;
    PetscReal         needed = find_row(g, aligned)[preset], thick = 0, layer = 0;

    PetscCall(measure_thickness(g, &thick));
    if (thick > 0 && thick / l->h < needed * (1 - 1e-6)) *b = (Breach){g, thick / l->h, needed, PETSC_FALSE};
    if (b->needed != 0) break;
    PetscCall(measure_layer(l->dim, g, stream, thick, &layer));
    needed = g->nclamped ? STREAM[preset] : PromiseFallLayer(preset, (PetscBool)(s->n > 1));
    if (layer / l->h < needed) *b = (Breach){g, layer / l->h, needed, PETSC_TRUE};
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* "group 'flag' is 1.0 cells thick and with -couple_method aligned needs 2. Refine the mesh (...), use -preset fast" */
static PetscErrorCode describe(const MeshLocal *l, const SolidsState *s, const Stream *stream, PetscInt preset,
                               PetscBool aligned, const char remedy[], const Breach *b, char text[], size_t len)
{
  const char *what = b->g->membrane ? "membrane" : "elastic";
  char        size[192], less[64] = "";
  Breach      other;

  PetscFunctionBeginUser;
  for (PetscInt p = 0; p < preset; p++) {
    PetscCall(find_breach(l, s, stream, p, aligned, &other));
    if (other.needed == 0) PetscCall(PromiseOffer(p, less, sizeof(less)));
  }
  if (b->layer)
    PetscCall(PetscSNPrintf(size, sizeof(size),
                            "the boundary layer of %s group '%s' is %.2f cells thick and needs %.2g", what, b->g->name,
                            (double)b->cells, (double)b->needed));
  else if (b->needed == NEVER)
    PetscCall(PetscSNPrintf(size, sizeof(size), "%s group '%s' is %s, where it is not promised", what, b->g->name,
                            !aligned         ? "immersed"
                            : in_space(b->g) ? "in space"
                                             : "around another viscosity"));
  else
    PetscCall(PetscSNPrintf(size, sizeof(size),
                            "%s group '%s' is %.1f cells thick and with -couple_method %s needs %.2g", what, b->g->name,
                            (double)b->cells, aligned ? "aligned" : "penalty", (double)b->needed));
  PetscCall(find_breach(l, s, stream, preset, PETSC_TRUE, &other));
  if (aligned || other.needed != 0) remedy = "";
  PetscCall(PetscSNPrintf(text, len, "%s%s%s%s", size,
                          b->needed == NEVER ? "" : ". Refine the mesh (-mesh_cells, -mesh_focus_h, -mesh_levels)",
                          less, remedy));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode SolidPromiseCheck(Mesh mesh, Bodies bodies, Solids solids, PetscInt preset, PetscBool asked,
                                 char refusal[], size_t len)
{
  const MeshLocal *l;
  SolidsState     *s;
  Stream           stream = {.speed = 0};
  char             text[512];
  PetscBool        can, aligned;
  Breach           b;

  PetscFunctionBeginUser;
  if (!solids) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(MeshGetLocal(mesh, &l));
  PetscCall(SolidsGetState(solids, &s));
  PetscCall(PromiseIsAligned(&aligned));
  PetscCall(SolidPromiseCanAlign(l, bodies, solids, &can));
  PetscCall(StreamFind(mesh, bodies, PETSC_FALSE, &stream));
  PetscCall(find_breach(l, s, &stream, preset, aligned, &b));
  if (b.needed == 0) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(
    describe(l, s, &stream, preset, aligned, can ? ", use -couple_method aligned" : "", &b, text, sizeof(text)));
  PetscCall(PromiseSay(preset, asked, text, refusal, len));
  PetscFunctionReturn(PETSC_SUCCESS);
}
