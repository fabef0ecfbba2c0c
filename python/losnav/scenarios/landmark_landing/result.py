class LandingResult:
    def __init__(s,*a): s.scenario,s.runs,s.seed,s.arrays=a
