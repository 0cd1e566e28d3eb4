/* Expressions: see expr.h. One parser a value; the variables it sees are four numbers of the Expr. Points are taken in
   a loop of our own, since the bulk mode of muParser starts threads. */
#include "compat.h"
#include "base/runcomm.h"
#include "base/expr.h"
#include "optimpl.h"
#include <ctype.h>
#include <muParserDLL.h>
#include <string.h>

#define MAX_VALUES 8
#define TIME       3 /* place of t among the variables */
#define VARIABLES  (EXPR_VARIABLES + EXPR_FIELDS)

struct _p_Expr {
  char             *name, *text;
  PetscInt          n, dim;
  muParserHandle_t *parser;                      /* [n] */
  double            variable[VARIABLES];         /* in the order of NAMES */
  PetscBool         uses[MAX_VALUES][VARIABLES]; /* does value i depend on it? */
  PetscInt          m;                           /* what ExprKeep has: number of points, -1: nothing */
  PetscReal         time, *x, *value;            /* x [m][dim], value [m][n] */
  PetscReal         last[2], *integral;          /* ExprIntegrate: the last two times, their integrals [2][n] */
  PetscInt          next;
};

static const char *const NAMES[EXPR_VARIABLES] = {"x", "y", "z", "t", "u", "v", "w", "angle", "omega"};

static char     field_name[EXPR_FIELDS][64];
static PetscInt nfield;

/* Is the name one of a list such as "x, y, t"? */
static PetscBool is_listed(const char name[], const char list[])
{
  const size_t n = strlen(name);

  for (const char *at = list; (at = strstr(at, name)); at++)
    if ((at == list || at[-1] == ' ') && (!at[n] || at[n] == ',')) return PETSC_TRUE;
  return PETSC_FALSE;
}

/* ---- text ---- */

/* The comma that ends the item, or the end of the text; commas in brackets separate arguments of functions */
static const char *find_end(const char item[])
{
  PetscInt depth = 0;

  for (; *item && (*item != ',' || depth > 0); item++) depth += *item == '(' ? 1 : *item == ')' ? -1 : 0;
  return item;
}

static PetscInt count_expressions(const char text[])
{
  PetscInt n = 1;

  for (const char *end = find_end(text); *end; end = find_end(end + 1)) n++;
  return n;
}

PetscBool OptIsNumbers(const char text[])
{
  char item[OPT_LINE], *end;

  for (const char *cursor = text; OptNextItem(&cursor, item, sizeof(item));) {
    (void)strtod(item, &end);
    if (end == item || *end) return PETSC_FALSE;
  }
  return PETSC_TRUE;
}

/* Without blanks, and in brackets where PETSc would take it for an option; free it */
static PetscErrorCode tidy(const char text[], char **out)
{
  char *o;

  PetscFunctionBeginUser;
  PetscCall(PetscMalloc1(strlen(text) + 3, out));
  o = *out;
  while (isspace((unsigned char)*text)) text++;
  if (text[0] == '-' && !isdigit((unsigned char)text[1]) && text[1] != '.') {
    const char *end = find_end(text);

    *o++ = '(';
    for (; text < end; text++)
      if (!isspace((unsigned char)*text)) *o++ = *text;
    *o++ = ')';
  }
  for (; *text; text++)
    if (!isspace((unsigned char)*text)) *o++ = *text;
  *o = 0;
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- reading ---- */

PetscErrorCode ExprNameFields(PetscInt n, const char *const names[])
{
  PetscFunctionBeginUser;
  PetscCheck(n <= EXPR_FIELDS, PETSC_COMM_SELF, PETSC_ERR_PLIB, "%" PetscInt_FMT " fields", n);
  nfield = n;
  for (PetscInt k = 0; k < nfield; k++) PetscCall(PetscStrncpy(field_name[k], names[k], sizeof(field_name[k])));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscBool is_field(const char name[])
{
  for (PetscInt k = 0; k < nfield; k++)
    if (!strcmp(name, field_name[k])) return PETSC_TRUE;
  return PETSC_FALSE;
}

/* muParser's message without its own place and full stop: ours counts in the whole text */
static void shorten(const char message[], char out[], size_t len)
{
  char *at;

  (void)snprintf(out, len, "%s", message);
  for (char *s = out; *s; s++)
    if (*s == '"') *s = '\'';
  at = strstr(out, " found at position");
  if (!at) at = strstr(out, " at position");
  if (at) *at = 0;
  else if (out[0] && out[strlen(out) - 1] == '.') out[strlen(out) - 1] = 0;
}

static PetscErrorCode refuse(const char name[], const OptSpec *spec, PetscInt dim, const char text[], size_t at,
                             const char why[])
{
  char known[64];

  PetscFunctionBeginUser;
  (void)snprintf(known, sizeof(known), "%s", spec->variables);
  for (const char *const *space = (const char *const[]){", z", ", w", NULL}; dim == 2 && *space; space++) {
    char *at = strstr(known, *space);

    if (at) memmove(at, at + 3, strlen(at + 3) + 1);
  }
  SETERRQ(RunComm(), PETSC_ERR_USER_INPUT,
          "Option %s = %s is wrong at character %zu: %s (known: numbers, %s, pi, + - * / ^, functions such as sin and sqrt)",
          name, text, at + 1, why, known);
}

/* muParser would let an expression set a variable */
static const char *find_assignment(const char s[])
{
  for (const char *c = s; *c; c++) {
    if (*c != '=') continue;
    if (c[1] == '=') c++;
    else if (c == s || !strchr("<>!", c[-1])) return c;
  }
  return NULL;
}

/* Parser of value i, whose text begins at character `at` of the option's */
static PetscErrorCode create_parser(Expr e, const OptSpec *spec, PetscInt i, const char text[], size_t at,
                                    const char all[])
{
  muParserHandle_t p    = mupCreate(muBASETYPE_FLOAT);
  const char      *sets = find_assignment(text);
  char             why[256];

  PetscFunctionBeginUser;
  e->parser[i] = p;
  mupDefineConst(p, "pi", PETSC_PI);
  for (PetscInt k = 0; k < nfield && is_listed("scalars", spec->variables); k++)
    mupDefineVar(p, field_name[k], &e->variable[EXPR_VARIABLES + k]);
  for (PetscInt v = 0; v < EXPR_VARIABLES; v++)
    if (is_listed(NAMES[v], spec->variables) && !((v == 2 || v == 6) && e->dim == 2))
      mupDefineVar(p, NAMES[v], &e->variable[v]);
  if (sets)
    PetscCall(refuse(e->name, spec, e->dim, all, at + (size_t)(sets - text), "'=' sets something, equality is '=='"));
  if (!text[strspn(text, " \t")]) PetscCall(refuse(e->name, spec, e->dim, all, at, "an expression is missing"));
  mupSetExpr(p, text);
  (void)mupEval(p);
  if (mupError(p)) {
    const muInt_t where = mupGetErrorPos(p);

    shorten(mupGetErrorMsg(p), why, sizeof(why));
    PetscCall(refuse(e->name, spec, e->dim, all, at + (where > 0 ? (size_t)where : 0), why));
  }
  for (PetscInt k = 0; k < mupGetExprVarNum(p); k++) {
    const char *name;
    double     *value;

    mupGetExprVar(p, (unsigned)k, &name, &value);
    if (value < e->variable + EXPR_VARIABLES && is_field(name) && is_listed("scalars", spec->variables)) {
      (void)snprintf(why, sizeof(why), "'%s' is a scalar, too: give that another name", name);
      PetscCall(refuse(e->name, spec, e->dim, all, at, why));
    }
    e->uses[i][value - e->variable] = PETSC_TRUE;
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* The bracket that nothing closes, NULL: none */
static const char *find_open(const char text[])
{
  PetscInt depth = 0;

  for (const char *c = text + strlen(text); c-- > text;) {
    depth += *c == ')' ? 1 : *c == '(' ? -1 : 0;
    if (depth < 0) return c;
  }
  return NULL;
}

static PetscErrorCode create(const char name[], const OptSpec *spec, PetscInt dim, PetscInt n, const char text[],
                             Expr *expr)
{
  const PetscInt got = count_expressions(text);
  const char    *at  = text;
  char           meaning[OPT_LINE], *part;
  Expr           e;

  PetscFunctionBeginUser;
  if (find_open(text))
    PetscCall(refuse(name, spec, dim, text, (size_t)(find_open(text) - text), "this bracket is not closed"));
  OptFormatMeaning(spec, meaning, sizeof(meaning));
  PetscCheck(got == n, RunComm(), PETSC_ERR_USER_INPUT,
             "Option %s = %s has %" PetscInt_FMT " value%s, %" PetscInt_FMT " are wanted (separated by commas): %s",
             name, text, got, got == 1 ? "" : "s", n, meaning);
  PetscCall(PetscNew(&e));
  *expr  = e;
  e->n   = n;
  e->dim = dim;
  e->m   = -1;
  PetscCall(PetscStrallocpy(name, &e->name));
  PetscCall(PetscCalloc1(n, &e->parser));
  PetscCall(PetscMalloc1(strlen(text) + 1, &part));
  for (PetscInt i = 0; i < n; i++) {
    const char *end = find_end(at);

    PetscCall(PetscStrncpy(part, at, (size_t)(end - at) + 1));
    PetscCall(create_parser(e, spec, i, part, (size_t)(at - text), text));
    at = end + 1;
  }
  PetscCall(PetscFree(part));
  PetscCall(tidy(text, &e->text));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Numbers in the place of one that depends on nothing */
static PetscErrorCode reduce(Expr *expr, PetscReal value[])
{
  PetscFunctionBeginUser;
  for (PetscInt i = 0; i < (*expr)->n * VARIABLES; i++)
    if ((*expr)->uses[i / VARIABLES][i % VARIABLES]) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(ExprEvaluate(*expr, 0, 1, NULL, value));
  PetscCall(ExprDestroy(expr));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ExprPeek(const char name[], PetscInt dim, PetscInt n, PetscReal value[], Expr *expr)
{
  const OptSpec *spec = OptFindSpec(name);
  char           text[OPT_LINE];
  PetscInt       given;

  PetscFunctionBeginUser;
  *expr = NULL;
  PetscCall(OptPeek(name, text, sizeof(text)));
  if (!text[0] || !spec || !spec->variables) PetscFunctionReturn(PETSC_SUCCESS);
  if (OptIsNumbers(text)) PetscCall(OptPeekReals(name, n, value, &given));
  if (OptIsNumbers(text)) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(create(name, spec, dim, n, text, expr));
  PetscCall(reduce(expr, value));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ExprRead(const char name[], PetscInt dim, PetscInt n, PetscReal value[], Expr *expr, PetscBool *found)
{
  const OptSpec *spec = NULL;
  const char    *text;
  char          *copy;

  PetscFunctionBeginUser;
  *expr = NULL;
  PetscCall(OptBeginReading(name, OPT_REALS, PETSC_FALSE, &spec));
  PetscCall(OptFindText(name, spec, &text));
  PetscCheck(spec->variables && n <= MAX_VALUES, RunComm(), PETSC_ERR_PLIB,
             "The row of option %s in options.c takes no expressions", name);
  if (found) *found = text ? PETSC_TRUE : PETSC_FALSE;
  if (!text || OptIsNumbers(text)) {
    PetscCall(OptRealArray(name, n, value, found));
    PetscFunctionReturn(PETSC_SUCCESS);
  }
  PetscCall(PetscStrallocpy(text, &copy)); /* the database changes below */
  PetscCall(create(name, spec, dim, n, copy, expr));
  PetscCall(PetscFree(copy));
  PetscCall(PetscOptionsSetValue(NULL, name, (*expr)->text));
  PetscCall(reduce(expr, value));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ExprDestroy(Expr *expr)
{
  Expr e = *expr;

  PetscFunctionBeginUser;
  if (!e) PetscFunctionReturn(PETSC_SUCCESS);
  for (PetscInt i = 0; i < e->n; i++)
    if (e->parser[i]) mupRelease(e->parser[i]);
  PetscCall(PetscFree(e->parser));
  PetscCall(PetscFree(e->name));
  PetscCall(PetscFree(e->text));
  PetscCall(PetscFree(e->x));
  PetscCall(PetscFree(e->value));
  PetscCall(PetscFree(e->integral));
  PetscCall(PetscFree(*expr));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscBool ExprValueUsesTime(Expr e, PetscInt i)
{
  return e->uses[i][TIME];
}

PetscBool ExprUsesTime(Expr e)
{
  for (PetscInt i = 0; i < e->n; i++)
    if (e->uses[i][TIME]) return PETSC_TRUE;
  return PETSC_FALSE;
}

PetscBool ExprUsesPosition(Expr e)
{
  for (PetscInt i = 0; i < 3 * e->n; i++)
    if (e->uses[i / 3][i % 3]) return PETSC_TRUE;
  return PETSC_FALSE;
}

PetscBool ExprUses(Expr e, PetscInt i, ExprVariable v)
{
  return e->uses[i][v];
}

PetscBool ExprUsesField(Expr e, PetscInt k)
{
  for (PetscInt i = 0; i < e->n; i++)
    if (e->uses[i][EXPR_VARIABLES + k]) return PETSC_TRUE;
  return PETSC_FALSE;
}

PetscBool ExprUsesFields(Expr e)
{
  for (PetscInt k = 0; k < nfield && e; k++)
    if (ExprUsesField(e, k)) return PETSC_TRUE;
  return PETSC_FALSE;
}

const char *ExprText(Expr e)
{
  return e->text;
}

/* ---- evaluation ---- */

/* One that is not finite, with its variables */
typedef struct {
  double i, value, variable[VARIABLES]; /* i < 0: none */
} Fault;

static PetscErrorCode refuse_value(MPI_Comm comm, Expr e, const Fault *f)
{
  const PetscReal *v = f->variable;
  char             uses_position[96];

  PetscFunctionBeginUser;
  (void)snprintf(uses_position, sizeof(uses_position), e->dim == 3 ? "x = %g, y = %g, z = %g" : "x = %g, y = %g", v[0],
                 v[1], v[2]);
  SETERRQ(comm, PETSC_ERR_USER_INPUT,
          "Option %s = %s: value %d is %g%s%s, t = %g: write expressions that are finite everywhere", e->name, e->text,
          (int)f->i + 1, f->value, ExprUsesPosition(e) ? " at " : "", ExprUsesPosition(e) ? uses_position : "",
          v[TIME]);
}

/* Value i of the variables as they are */
static void evaluate_one(Expr e, PetscInt i, PetscReal *value, Fault *fault)
{
  *value = mupEval(e->parser[i]);
  if (!PetscIsInfOrNanReal(*value) || fault->i >= 0) return;
  fault->i     = (double)i;
  fault->value = *value;
  memcpy(fault->variable, e->variable, sizeof(fault->variable));
}

/* Stop if any rank has met one: that of the lowest rank is told by all */
static PetscErrorCode broadcast_fault(Expr e, Fault *fault)
{
  PetscMPIInt rank, size, first;

  PetscFunctionBeginUser;
  PetscCallMPI(MPI_Comm_rank(RunComm(), &rank));
  PetscCallMPI(MPI_Comm_size(RunComm(), &size));
  first = fault->i >= 0 ? rank : size;
  PetscCallMPI(MPI_Allreduce(MPI_IN_PLACE, &first, 1, MPI_INT, MPI_MIN, RunComm()));
  if (first == size) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCallMPI(MPI_Bcast(fault, sizeof(*fault) / sizeof(double), MPI_DOUBLE, first, RunComm()));
  PetscCall(refuse_value(RunComm(), e, fault));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static void evaluate_all(Expr e, PetscReal time, PetscInt m, const PetscReal x[], PetscReal value[], Fault *fault)
{
  e->variable[TIME] = time;
  for (PetscInt i = 0; i < e->n; i++) {
    const PetscBool uses_position = (PetscBool)(x && (e->uses[i][0] || e->uses[i][1] || e->uses[i][2]));

    for (PetscInt p = 0; p < m; p++) {
      for (PetscInt d = 0; d < e->dim && uses_position; d++) e->variable[d] = x[p * e->dim + d];
      if (p == 0 || uses_position) evaluate_one(e, i, &value[p * e->n + i], fault);
      else value[p * e->n + i] = value[i];
    }
  }
}

PetscErrorCode ExprEvaluate(Expr e, PetscReal time, PetscInt m, const PetscReal x[], PetscReal value[])
{
  Fault fault = {.i = -1};

  PetscFunctionBeginUser;
  evaluate_all(e, time, m, x, value, &fault);
  if (ExprUsesPosition(e))
    PetscCall(broadcast_fault(e, &fault)); /* a rank without points takes part; its x may be NULL */
  else if (fault.i >= 0) PetscCall(refuse_value(RunComm(), e, &fault));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ExprEvaluateAlone(Expr e, PetscReal time, const PetscReal x[], PetscReal value[])
{
  Fault fault = {.i = -1};

  PetscFunctionBeginUser;
  evaluate_all(e, time, 1, x, value, &fault);
  if (fault.i >= 0) PetscCall(refuse_value(PETSC_COMM_SELF, e, &fault));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ExprEvaluateAt(Expr e, const PetscReal variable[], const PetscReal field[], PetscReal value[])
{
  Fault fault = {.i = -1};

  PetscFunctionBeginUser;
  for (PetscInt v = 0; v < EXPR_VARIABLES; v++) e->variable[v] = variable[v];
  for (PetscInt k = 0; k < nfield && field; k++) e->variable[EXPR_VARIABLES + k] = field[k];
  for (PetscInt i = 0; i < e->n; i++) evaluate_one(e, i, &value[i], &fault);
  if (fault.i >= 0) PetscCall(refuse_value(PETSC_COMM_SELF, e, &fault));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ExprEvaluateFields(Expr e, PetscReal time, PetscInt m, const PetscReal x[],
                                  const PetscReal *const field[], PetscReal value[])
{
  Fault fault = {.i = -1};

  PetscFunctionBeginUser;
  e->variable[TIME] = time;
  for (PetscInt p = 0; p < m; p++) {
    for (PetscInt d = 0; d < e->dim; d++) e->variable[d] = x[p * e->dim + d];
    for (PetscInt k = 0; k < nfield; k++) e->variable[EXPR_VARIABLES + k] = field[k] ? field[k][p] : 0;
    evaluate_one(e, 0, &value[p], &fault);
  }
  PetscCall(broadcast_fault(e, &fault));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ExprKeep(Expr e, PetscReal time, PetscInt m, const PetscReal x[], const PetscReal *value[])
{
  PetscBool same = (PetscBool)(e->m == m && (time == e->time || !ExprUsesTime(e)));

  PetscFunctionBeginUser;
  if (same) PetscCall(PetscArraycmp(e->x, x, m * e->dim, &same));
  PetscCallMPI(MPI_Allreduce(MPI_IN_PLACE, &same, 1, COMPAT_MPI_BOOL, MPI_LAND, RunComm()));
  if (!same) {
    if (e->m != m) {
      PetscCall(PetscFree(e->x));
      PetscCall(PetscFree(e->value));
      PetscCall(PetscMalloc1(m * e->dim, &e->x));
      PetscCall(PetscMalloc1(m * e->n, &e->value));
    }
    PetscCall(PetscArraycpy(e->x, x, m * e->dim));
    e->m    = m;
    e->time = time;
    PetscCall(ExprEvaluate(e, time, m, x, e->value));
  }
  *value = e->value;
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- integration ---- */

#define PANELS 64
#define DEPTH  12 /* halvings of a panel, for kinks and what is noise */
#define CLOSE  1e-13

/* QUADPACK's qk15: points in [0, 1] from the outermost to the middle; weights of 15 points, of 7 (every second) */
static const PetscReal POINT[8] = {0.991455371120812639206854697526329, 0.949107912342758524526189684047851,
                                   0.864864423359769072789712788640926, 0.741531185599394439863864773280788,
                                   0.586087235467691130294144691693013, 0.405845151377397166906606412076961,
                                   0.207784955007898467600689403773245, 0};
static const PetscReal FINE[8]  = {0.022935322010529224963732008058970, 0.063092092629978553290700663189204,
                                   0.104790010322250183839876322541518, 0.140653259715525918745189590510238,
                                   0.169004726639267902826583426598550, 0.190350578064785409913256402421014,
                                   0.204432940075298892414161999234649, 0.209482141084727828012999174891714};
static const PetscReal RAW[8]   = {0, 0.129484966168869693270611432679082, 0, 0.279705391489276667901467771423780,
                                   0, 0.381830050505118944950369775488975, 0, 0.417959183673469387755102040816327};

/* Adds the integral of value i over [a, b] to *sum, that of its absolute value to *size */
static void integrate(Expr e, PetscInt i, PetscReal a, PetscReal b, PetscInt depth, PetscReal *sum, PetscReal *size,
                      Fault *fault)
{
  const PetscReal middle = 0.5 * (a + b), half = 0.5 * (b - a);
  PetscReal       fine = 0, raw = 0, absolute = 0, v;

  for (PetscInt k = 0; k < 15; k++) {
    const PetscInt j = k < 8 ? k : 14 - k;

    e->variable[TIME] = middle + (k < 8 ? -half : half) * POINT[j];
    evaluate_one(e, i, &v, fault);
    fine += half * FINE[j] * v;
    raw += half * RAW[j] * v;
    absolute += PetscAbsReal(half * FINE[j] * v);
  }
  if (depth == 0 || PetscAbsReal(fine - raw) <= CLOSE * PetscMax(absolute, *size / PANELS) || fault->i >= 0) {
    *sum += fine;
    *size += absolute;
  } else {
    integrate(e, i, a, middle, depth - 1, sum, size, fault);
    integrate(e, i, middle, b, depth - 1, sum, size, fault);
  }
}

PetscErrorCode ExprIntegrate(Expr e, PetscReal time, PetscReal value[])
{
  Fault fault = {.i = -1};

  PetscFunctionBeginUser;
  if (!e->integral) PetscCall(PetscCalloc1(2 * e->n, &e->integral)); /* both of the time 0 */
  for (PetscInt k = 0; k < 2; k++) {
    if (e->last[k] != time) continue;
    PetscCall(PetscArraycpy(value, e->integral + k * e->n, e->n));
    PetscFunctionReturn(PETSC_SUCCESS);
  }
  for (PetscInt i = 0; i < e->n; i++) {
    PetscReal size = 0;

    value[i] = 0;
    if (e->uses[i][TIME])
      for (PetscInt k = 0; k < PANELS; k++)
        integrate(e, i, time * k / PANELS, time * (k + 1) / PANELS, DEPTH, &value[i], &size, &fault);
    else {
      evaluate_one(e, i, &value[i], &fault);
      value[i] *= time;
    }
  }
  if (fault.i >= 0) PetscCall(refuse_value(RunComm(), e, &fault));
  e->last[e->next] = time;
  PetscCall(PetscArraycpy(e->integral + e->next * e->n, value, e->n));
  e->next = 1 - e->next;
  PetscFunctionReturn(PETSC_SUCCESS);
}
