"""Speed of a squirmer with little inertia and power of its slip, by sympy: /usr/bin/python3 runs/studies/swimmers/derive.py"""
# O(Re) speed of a squirmer (a = 1, U0 = 2/3 B1): U1 = -(rho/6 pi mu) int (v.grad v).K dV, v = u - U0 e
import sympy as S
r,t,B1,B2=S.symbols('r t B1 B2',positive=True)
c=S.cos(t); s=S.sin(t)
U=2*B1/3
ur=U*c/r**3 + B2*(1/r**4-1/r**2)*(3*c**2-1)/2
ut=U*s/(2*r**3) + B2*s*c/r**4
vr=ur-U*c; vt=ut+U*s
kr=S.Rational(3,2)/r*c-c/(2*r**3); kt=-(S.Rational(3,4)/r+1/(4*r**3))*s
ar=vr*S.diff(vr,r)+vt/r*S.diff(vr,t)-vt**2/r
at=vr*S.diff(vt,r)+vt/r*S.diff(vt,t)+vr*vt/r
f=S.expand(S.expand((ar*kr+at*kt)*s*r**2))
I=S.integrate(S.simplify(S.integrate(f,(t,0,S.pi))),(r,1,S.oo))*2*S.pi
print(S.simplify(-I/(6*S.pi)), 'over U0*beta*Re, Re=U0:', S.simplify(-I/(6*S.pi)/U/(B2/B1)/U))
# power per mu: - int over sphere of the traction times slip, in the frame of the body
tau=S.diff(vt,r)-vt/r+S.diff(vr,t)/r
P=-S.integrate(S.expand((tau*(B1*s+B2*s*c)).subs(r,1)*s),(t,0,S.pi))*2*S.pi
print('power/mu a', S.simplify(P))
