/* Scalars, options: see scalar.h. */
#include "compat.h"
#include "impl.h"
#include "base/opt.h"

#define RTOL         1e-3
#define MAX_SCALARS  EXPR_FIELDS
#define CONDUCTIVITY 0.01 /* defaults */
#define CAPACITY     1

/* "-scalar_<scalar>_<ending>" */
static const char *name_option(const Scalar *s, const char ending[], char name[OPT_NAME])
{
  (void)snprintf(name, OPT_NAME, "-scalar_%s_%s", s->name, ending);
  return name;
}

static PetscErrorCode read_number(const char option[], PetscInt dim, ScalarNumber *n)
{
  PetscFunctionBeginUser;
  PetscCall(ExprRead(option, dim, 1, &n->value, &n->formula, &n->given));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ScalarEvaluateNumber(const ScalarNumber *number, PetscReal time, PetscInt n, const PetscReal x[],
                                    PetscReal value[])
{
  PetscFunctionBeginUser;
  if (number->formula && ExprUsesPosition(number->formula)) {
    PetscCall(ExprEvaluate(number->formula, time, n, x, value));
    PetscFunctionReturn(PETSC_SUCCESS);
  }
  if (number->formula) {
    PetscReal one;

    PetscCall(ExprEvaluate(number->formula, time, 1, NULL, &one));
    for (PetscInt i = 0; i < n; i++) value[i] = one;
  } else
    for (PetscInt i = 0; i < n; i++) value[i] = number->value;
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode read_condition(Scalars all, Scalar *s, PetscInt b)
{
  const PetscInt   dim = all->loc->dim;
  ScalarCondition *c   = s->condition + b;
  const char      *boundary;
  char             ending[OPT_NAME], name[OPT_NAME];
  PetscBool        transfer;

  PetscFunctionBeginUser;
  PetscCall(MeshGetBoundaryName(all->mesh, b, &boundary));
  PetscCall(read_number(name_option(s, OptJoin("bc_", boundary, "_value", ending), name), dim, &c->value));
  PetscCall(read_number(name_option(s, OptJoin("bc_", boundary, "_flux", ending), name), dim, &c->flux));
  PetscCall(OptHas(name_option(s, OptJoin("bc_", boundary, "_transfer", ending), name), &transfer));
  PetscCheck(!c->value.given || (!c->flux.given && !transfer), all->comm, PETSC_ERR_USER_INPUT,
             "-scalar_%s_bc_%s_value %g: a boundary has a value, or a flux and a transfer coefficient: remove "
             "-scalar_%s_bc_%s_%s, or the value",
             s->name, boundary, (double)c->value.value, s->name, boundary, transfer ? "transfer" : "flux");
  if (c->value.given) c->kind = SCALAR_VALUE;
  else if (c->flux.given || transfer) c->kind = SCALAR_FLUX;
  if (!transfer) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(OptReal(name, &c->transfer));
  c->ambient.value = s->par.reference;
  PetscCall(read_number(name_option(s, OptJoin("bc_", boundary, "_ambient", ending), name), dim, &c->ambient));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ScalarsPeekDiffusivity(const char scalar[], PetscReal *diffusivity)
{
  PetscReal conductivity = CONDUCTIVITY, capacity = CAPACITY;
  PetscBool given;
  char      name[OPT_NAME];

  PetscFunctionBeginUser;
  PetscCall(OptPeekReal(OptJoin("-scalar_", scalar, "_conductivity", name), &conductivity, &given));
  PetscCall(OptPeekReal(OptJoin("-scalar_", scalar, "_capacity", name), &capacity, &given));
  *diffusivity = conductivity / capacity;
  PetscCall(OptPeekReal(OptJoin("-scalar_", scalar, "_diffusivity", name), diffusivity, &given));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode read_conduction(Scalars all, Scalar *s)
{
  char      name[OPT_NAME], other[OPT_NAME];
  PetscReal diffusivity = 0;
  PetscBool given, both;

  PetscFunctionBeginUser;
  s->par.capacity     = CAPACITY;
  s->par.conductivity = CONDUCTIVITY;
  PetscCall(OptReal(name_option(s, "capacity", name), &s->par.capacity));
  PetscCall(OptHas(name_option(s, "conductivity", other), &both));
  PetscCall(OptReal(other, &s->par.conductivity));
  PetscCall(OptHas(name_option(s, "diffusivity", name), &given));
  PetscCheck(!given || !both, all->comm, PETSC_ERR_USER_INPUT,
             "Option %s: the diffusivity is the conductivity over the capacity, and %s gives that already: remove one of the two",
             name, other);
  if (!given) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(OptReal(name, &diffusivity));
  s->par.conductivity = diffusivity * s->par.capacity;
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode read_gradient(Scalars all, Scalar *s)
{
  const PetscInt dim = all->loc->dim;
  char           name[OPT_NAME];

  PetscFunctionBeginUser;
  PetscCall(OptRealArray(name_option(s, "gradient", name), dim, s->par.gradient, NULL));
  for (PetscInt a = 0; a < dim; a++) {
    if (s->par.gradient[a] == 0) continue;
    s->par.periodic_gradient = PETSC_TRUE;
    PetscCheck(all->loc->period[a] > 0, all->comm, PETSC_ERR_USER_INPUT,
               "Option %s: %g along %c, where the mesh is not periodic: give the boundaries there values, or make it periodic (-mesh_periodic)",
               name, (double)s->par.gradient[a], (char)('x' + a));
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* What uses it up in proportion to itself is implicit, as decay; the rest is a source */
static PetscErrorCode read_reaction(Scalars all, Scalar *s)
{
  char      name[OPT_NAME];
  PetscReal rate[MAX_SCALARS] = {0};
  PetscBool any               = PETSC_FALSE;
  PetscInt  own               = (PetscInt)(s - all->scalar);

  PetscFunctionBeginUser;
  PetscCall(OptRealArray(name_option(s, "reaction", name), all->n, rate, NULL));
  if (rate[own] < 0) {
    s->decay -= rate[own];
    rate[own] = 0;
  }
  for (PetscInt i = 0; i < all->n; i++) any = (PetscBool)(any || rate[i] != 0);
  if (!any) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(PetscMalloc1(all->n, &s->gain));
  PetscCall(PetscArraycpy(s->gain, rate, all->n));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Does a source or flux go by scalars? Not by what grows without bounds. */
static PetscErrorCode check_sources(Scalars all, PetscInt i)
{
  Scalar *s = all->scalar + i;

  PetscFunctionBeginUser;
  s->input.reacts = (PetscBool)(s->gain || ExprUsesFields(s->source.formula));
  for (PetscInt b = 0; b < all->nboundary; b++)
    s->input.reacts = (PetscBool)(s->input.reacts || ExprUsesFields(s->condition[b].flux.formula));
  for (PetscInt k = 0; k < all->n; k++) {
    const Scalar *of     = all->scalar + k;
    const char   *option = s->gain && s->gain[k] != 0                               ? "reaction"
                         : s->source.formula && ExprUsesField(s->source.formula, k) ? "source"
                                                                                    : NULL;

    for (PetscInt b = 0; b < all->nboundary; b++)
      if (s->condition[b].flux.formula && ExprUsesField(s->condition[b].flux.formula, k)) option = "bc_<boundary>_flux";
    PetscCheck(!option || !of->par.periodic_gradient, all->comm, PETSC_ERR_SUP,
               "-scalar_%s_%s goes by scalar '%s', which has a mean gradient: it would not be periodic; leave it out, or leave "
               "out -scalar_%s_gradient",
               s->name, option, of->name, of->name);
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode read_initial(Scalars all, Scalar *s)
{
  char name[OPT_NAME];

  PetscFunctionBeginUser;
  s->initial.value = s->par.reference;
  PetscCall(read_number(name_option(s, "initial", name), all->loc->dim, &s->initial));
  PetscCall(OptString(name_option(s, "initial_run", name), s->run, sizeof(s->run)));
  PetscCheck(!s->run[0] || !s->initial.given, all->comm, PETSC_ERR_USER_INPUT,
             "%s %s: the scalar starts with the fields of that run, and -scalar_%s_initial says another start: remove one of them",
             name, s->run, s->name);
  PetscCheck(!s->run[0] || !s->par.periodic_gradient, all->comm, PETSC_ERR_SUP,
             "%s %s: a scalar with a mean gradient cannot start from fields: leave out -scalar_%s_gradient, or continue the run "
             "(-sim_restart)",
             name, s->run, s->name);
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode read_scalar(Scalars all, Scalar *s)
{
  static const char *const STABILISE[] = {"auto", "none", NULL};
  char                     name[OPT_NAME];
  PetscInt                 none = 0;

  PetscFunctionBeginUser;
  s->par.name = s->name;
  PetscCall(read_conduction(all, s));
  PetscCall(OptReal(name_option(s, "expansion", name), &s->par.expansion));
  PetscCall(OptReal(name_option(s, "reference", name), &s->par.reference));
  PetscCall(read_number(name_option(s, "source", name), all->loc->dim, &s->source));
  PetscCall(OptReal(name_option(s, "decay", name), &s->decay));
  PetscCall(OptChoice(name_option(s, "stabilise", name), STABILISE, &none));
  s->limit.wanted = (PetscBool)!none;
  PetscCall(read_reaction(all, s));
  PetscCall(read_gradient(all, s));
  PetscCall(read_initial(all, s));
  PetscCall(OptReal(name_option(s, "reference_difference", name), &s->par.difference));
  s->par.length = 1;
  if (s->par.difference > 0) PetscCall(OptReal(name_option(s, "reference_length", name), &s->par.length));
  PetscCall(PetscCalloc1(all->nboundary, &s->condition));
  for (PetscInt b = 0; b < all->nboundary; b++) PetscCall(read_condition(all, s, b));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Names go into options and expressions: letters, digits and _, and no word of these */
static PetscErrorCode check_name(Scalars all, const char name[])
{
  static const char *const WORDS[] = {"x",    "y",    "z",     "t",    "u",     "v",     "w",     "pi",
                                      "e",    "sin",  "cos",   "tan",  "asin",  "acos",  "atan",  "sinh",
                                      "cosh", "tanh", "exp",   "ln",   "asinh", "acosh", "atanh", "atan2",
                                      "log",  "log2", "log10", "sqrt", "abs",   "sign",  "rint",  "min",
                                      "max",  "sum",  "avg",   "_pi",  "_e"};
  PetscBool                valid   = (PetscBool) !(name[0] >= '0' && name[0] <= '9');

  PetscFunctionBeginUser;
  for (const char *c = name; *c; c++)
    valid = (PetscBool)(valid && ((*c >= 'a' && *c <= 'z') || (*c >= 'A' && *c <= 'Z') || (*c >= '0' && *c <= '9') ||
                                  *c == '_'));
  PetscCheck(valid && name[0], all->comm, PETSC_ERR_USER_INPUT,
             "Option -scalars names '%s': a name has letters, digits and _ alone and begins with no digit, as expressions know it: "
             "call it otherwise",
             name);
  for (size_t k = 0; k < PETSC_STATIC_ARRAY_LENGTH(WORDS); k++)
    PetscCheck(strcmp(name, WORDS[k]), all->comm, PETSC_ERR_USER_INPUT,
               "Option -scalars names '%s', a word of expressions with another meaning: call the scalar otherwise",
               name);
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ScalarsRead(Scalars all)
{
  PetscInt    n = MAX_SCALARS;
  char       *list[MAX_SCALARS];
  const char *names[MAX_SCALARS];

  PetscFunctionBeginUser;
  PetscCall(OptStringArray("-scalars", &n, list));
  all->rtol = RTOL;
  if (n) PetscCall(OptReal("-scalars_rtol", &all->rtol));
  all->n = n;
  PetscCall(PetscCalloc1(n, &all->scalar));
  for (PetscInt i = 0; i < n; i++) {
    Scalar *s = all->scalar + i;

    PetscCall(PetscStrncpy(s->name, list[i], sizeof(s->name)));
    PetscCall(PetscFree(list[i]));
    PetscCall(check_name(all, s->name));
    for (PetscInt k = 0; k < i; k++)
      PetscCheck(strcmp(all->scalar[k].name, s->name), all->comm, PETSC_ERR_USER_INPUT,
                 "Option -scalars names '%s' twice: give each scalar a name of its own", s->name);
  }
  for (PetscInt i = 0; i < n; i++) names[i] = all->scalar[i].name;
  PetscCall(ExprNameFields(n, names));
  for (PetscInt i = 0; i < n; i++) PetscCall(read_scalar(all, all->scalar + i));
  for (PetscInt i = 0; i < n; i++) PetscCall(check_sources(all, i));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode forget_number(ScalarNumber *n)
{
  PetscFunctionBeginUser;
  PetscCall(ExprDestroy(&n->formula));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ScalarForgetOptions(Scalars all, Scalar *s)
{
  PetscFunctionBeginUser;
  for (PetscInt b = 0; b < all->nboundary; b++) {
    PetscCall(forget_number(&s->condition[b].value));
    PetscCall(forget_number(&s->condition[b].flux));
    PetscCall(forget_number(&s->condition[b].ambient));
  }
  PetscCall(forget_number(&s->initial));
  PetscCall(forget_number(&s->source));
  PetscCall(PetscFree(s->condition));
  PetscCall(PetscFree(s->gain));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ScalarsView(Scalars all, PetscViewer viewer)
{
  PetscFunctionBeginUser;
  for (PetscInt i = 0; i < all->n; i++) {
    const Scalar *s = all->scalar + i;

    PetscCall(PetscViewerASCIIPrintf(viewer, "scalar %s: conductivity %g, capacity %g (diffusivity %g)", s->name,
                                     (double)s->par.conductivity, (double)s->par.capacity,
                                     (double)(s->par.conductivity / s->par.capacity)));
    if (s->par.expansion != 0)
      PetscCall(PetscViewerASCIIPrintf(viewer, ", buoyancy: expansion %g from %g", (double)s->par.expansion,
                                       (double)s->par.reference));
    PetscCall(PetscViewerASCIIPrintf(viewer, "\n"));
    for (PetscInt b = 0; b < all->nboundary; b++) {
      static const char *const KINDS[] = {"no flux", "value", "flux"};
      const char              *name;

      PetscCall(MeshGetBoundaryName(all->mesh, b, &name));
      PetscCall(PetscViewerASCIIPrintf(viewer, "%s%s: %s", b ? ", " : "  ", name, KINDS[s->condition[b].kind]));
    }
    PetscCall(PetscViewerASCIIPrintf(viewer, "\n"));
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}
