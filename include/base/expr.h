/* Expressions: values of an option as formulas of x, y, z and t, those on bodies also of the body's motion.

   "0, -981*(1 + 0.1*sin(t))": one expression a value, separated by commas, in the unit of the option; muParser reads
   them (https://beltoforion.de/en/muparser): + - * / ^, comparisons, && || and ?:, sin cos tan asin acos atan sinh cosh
   tanh asinh acosh atanh atan2 exp ln log2 log10 sqrt abs sign rint min max sum avg, and pi. Which names an option
   knows is the `variables` of its row; z is not known in the plane. What depends on nothing becomes a number when it is
   read. Evaluated for many points at a time, on every rank to the same bits; expressions without t once for the same
   points.

   In the database, and so in options.txt, an expression has no blanks and does not begin with a minus and a letter,
   which PETSc would take for an option: on a command line such a one is written in brackets, "(-sin(t)),0". */
#pragma once
#include <petscsys.h>

typedef struct _p_Expr *Expr;

/* All variables that a row may name: a position, the time, and of a body its velocity, angle and angular velocity */
typedef enum {
  EXPR_X,
  EXPR_Y,
  EXPR_Z,
  EXPR_TIME,
  EXPR_U,
  EXPR_V,
  EXPR_W,
  EXPR_ANGLE,
  EXPR_OMEGA,
  EXPR_VARIABLES
} ExprVariable;

#define EXPR_FIELDS 16 /* at most */
/* Names of fields, from now on: options whose row has `scalars` among its variables know them too. Copied. */
PetscErrorCode ExprNameFields(PetscInt n, const char *const names[]);
/* Read n values of an option whose row has `variables`: numbers go to value [n] and *expr is NULL; expressions to *expr
   (the caller destroys it) while value stays. *found (may be NULL): was the option given? Not collective, the same on
   all ranks. Errors: other than n values; what muParser does not understand, with the text and the position in it. */
PetscErrorCode ExprRead(const char name[], PetscInt dim, PetscInt n, PetscReal value[], Expr *expr, PetscBool *found);
/* The same without reading it, for what is decided before it is read: the option counts as unread, the database stays
   as it is. *expr NULL: numbers, or absent, where value stays. */
PetscErrorCode ExprPeek(const char name[], PetscInt dim, PetscInt n, PetscReal value[], Expr *expr);
PetscErrorCode ExprDestroy(Expr *);
/* Does any value, or value i, depend on time? Does any depend on the position? */
PetscBool   ExprUsesTime(Expr);
PetscBool   ExprValueUsesTime(Expr, PetscInt i);
PetscBool   ExprUsesPosition(Expr);
PetscBool   ExprUses(Expr, PetscInt i, ExprVariable); /* does value i depend on it? */
PetscBool   ExprUsesField(Expr, PetscInt k);          /* does any depend on field k? */
PetscBool   ExprUsesFields(Expr);                     /* on any field? NULL, a number: no */
const char *ExprText(Expr);                           /* as read, without blanks. Borrowed. */

/* value [m][n] at points x [m][dim] (NULL: expressions of t alone) and a time. Collective where any value depends
   on the position; else all ranks ask for the same. Error: not finite. */
PetscErrorCode ExprEvaluate(Expr, PetscReal time, PetscInt m, const PetscReal x[], PetscReal value[]);
/* The one value of an expression at points x [m][dim] where fields have the values field [names][m], NULL those that
   it does not use: value [m]. Collective. Error: not finite. */
PetscErrorCode ExprEvaluateFields(Expr, PetscReal time, PetscInt m, const PetscReal x[], const PetscReal *const field[],
                                  PetscReal value[]);
/* At one position of this rank alone. Not collective. Error: not finite, raised by this rank. */
PetscErrorCode ExprEvaluateAlone(Expr, PetscReal time, const PetscReal x[], PetscReal value[]);
/* Of all variables, in the order of ExprVariable, and fields [names] (NULL: it uses none), on this rank alone. Not
   collective. Error: not finite, raised by this rank. */
PetscErrorCode ExprEvaluateAt(Expr, const PetscReal variable[], const PetscReal field[], PetscReal value[]);
/* The same as ExprEvaluate, kept: evaluated anew only if points or (with t) time differ from the last call. Borrowed
   until the next. Collective. */
PetscErrorCode ExprKeep(Expr, PetscReal time, PetscInt m, const PetscReal x[], const PetscReal *value[]);
/* value [n] = integral of expressions of t alone from 0 to time: adaptive Gauss-Kronrod quadrature (7, 15 points;
   Piessens et al. 1983) to 1e-13 of the integral of the absolute value, at kinks in pieces of time/2^18. A function of
   `time` alone, whatever was asked before. Not collective, the same on all ranks. */
PetscErrorCode ExprIntegrate(Expr, PetscReal time, PetscReal value[]);
