"""Plans: the model and mesh that a scene requires, and the stated error of its response.

The stated error is put together in `errors`. `simulate` plans a scene, solves it, and states the
error. Its modules work in this order:

    estimates      relevant lines of the load, reflections from the sides
    deflection     deflection of a sheet, and the error of a linear model of it
    refinement     element size, and the error of a mesh by comparison with another
    extent         the part of the body to model, and the error of its absorbing ends
    left_out       other errors by what a model leaves out
    errors         all parts of the stated error, and the response with its statement
    plan           the model and its mesh: a `record.Plan` with the `rows` of its reasons
    plan_warnings  warnings apart from the stated error

`assessment` states the error of a response that was computed without a plan. `budget` compares it
with the uncertainty due to material and device.
"""
